"""A few object frames with two cars each, and images beside them."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from data.array_store import ArrayStore
from data.open_drive import open_drive
from data.samples.images.input_images import ImageConfig
from data.samples.images.labelled_images import LabelledImages
from perception.detection.detectors.input_size import InputSize
from perception.types import Modality
from tests.car_frames import SIZE_PX, write_car_frames

SMALL = InputSize(96, 320)


def write_images(root: Path, frames: int) -> None:
    """Write images that are red on their left, blue on their right, and darker at every frame."""
    folder = root / "training" / "image_2"
    folder.mkdir()
    for number in range(frames):
        image = np.zeros((SIZE_PX[1], SIZE_PX[0], 3), np.uint8)
        image[:, : SIZE_PX[0] // 2, 2] = 250 - 10 * number  # OpenCV: blue, green, red
        image[:, SIZE_PX[0] // 2 :, 0] = 250 - 10 * number
        cv2.imwrite(str(folder / f"{number:06d}.png"), image)


@pytest.fixture
def make_frames(tmp_path: Path) -> Callable[..., Path]:
    """Write labelled frames with images; return their root."""

    def make(name: str = "object", frames: int = 5, **options: object) -> Path:
        root = write_car_frames(tmp_path / name, frames, **options)
        write_images(root, frames)
        return root

    return make


@pytest.fixture
def make_images(
    make_frames: Callable[..., Path], store: ArrayStore
) -> Callable[..., LabelledImages]:
    """Open frames, written anew unless a root is given, as pictures of a modality."""

    def make(
        modality: Modality = "dm", root: Path | None = None, **config: object
    ) -> LabelledImages:
        drive = open_drive(root or make_frames())
        return LabelledImages([drive], ImageConfig(modality, **{"size": SMALL, **config}), store)

    return make
