"""How a picture is changed at every look at it."""

from dataclasses import dataclass

import numpy as np

from data.pictures.wanted import PictureLabels
from perception.types import Modality, UInt8


@dataclass(frozen=True)
class PictureAugmentation:
    """The strength of each operation; 0 is off.

    Attributes:
        flip: probability of left and right changing places.
    """

    flip: float = 0.5


def changed(
    picture: UInt8,
    labels: PictureLabels,
    modality: Modality,
    strengths: PictureAugmentation,
    rng: np.random.Generator,
) -> tuple[UInt8, PictureLabels]:
    """Return a picture and its labels as another look would show them."""
    if rng.random() >= strengths.flip:
        return picture, labels
    width = picture.shape[1]
    boxes_px = labels.boxes_px[:, [2, 1, 0, 3]] * (-1, 1, -1, 1) + (width, 0, width, 0)
    flipped = PictureLabels(boxes_px.astype(np.float32), labels.classes, labels.is_ignored)
    return picture[:, ::-1], flipped
