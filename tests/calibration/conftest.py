"""Frames with boards, for all tests of the calibration."""

import numpy as np
import pytest

from perception.types import Frame
from tests.board_scenes import TRUE, Boards


@pytest.fixture(scope="session")
def board_frames():
    """Seven frames of other boards each, with the true calibration."""
    frames = []
    for seed in range(7):
        boards = Boards.drawn(14, seed)
        image = boards.image(np.random.default_rng(seed))
        frames.append(Frame(seed, 0.1 * seed, boards.scan(), image, calibration=TRUE))
    return frames
