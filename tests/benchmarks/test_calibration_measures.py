"""Other measures of a calibration, on boards before a wall."""

import numpy as np
import pytest

from perception.types import Frame
from tests.board_scenes import TRUE, Boards
from tests.reference.calibration_measures import mutual_information


@pytest.fixture(scope="module")
def frames():
    found = []
    for seed in range(3):
        boards = Boards.drawn(14, seed)
        points = boards.scan()
        points[:, 3] = np.where(points[:, 0] < 39, 0.8, 0.1)  # boards are bright in both
        image = boards.image(np.random.default_rng(seed))
        found.append(Frame(seed, 0.0, points, image, calibration=TRUE))
    return found


def test_mutual_information_is_highest_at_the_true_calibration(frames):
    here = mutual_information(frames, np.zeros(6))
    for axis in (0, 1):
        for sign in (-1, 1):
            turned = sign * np.radians(1.0) * np.eye(6)[axis]
            assert mutual_information(frames, turned) < here
