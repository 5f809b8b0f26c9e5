"""Input size of a detector: images are stretched to it, and boxes are scaled back to the image.

A fully convolutional network is exported with an input of nearly the shape of the images, with about as many pixels
as in training; the thesis' network takes 416x416 only.
"""

import math
import re
from typing import NamedTuple, Self

import cv2
import numpy as np

from perception.errors import UsageError
from perception.types import Float64, Modality, UInt8

SIZE_STEP_PX = 32  # every trunk halves its input five times


class InputSize(NamedTuple):
    """Size of a network's input."""

    height_px: int
    width_px: int

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the size of a text such as 192x640: height and width, multiples of 32.

        Raises:
            UsageError: the text is no such size.
        """
        found = re.fullmatch(r"(\d+)x(\d+)", text)
        sides = [int(side) for side in found.groups()] if found else [0]
        if min(sides) < SIZE_STEP_PX or any(side % SIZE_STEP_PX for side in sides):
            raise UsageError(
                "input size",
                expected=f"HEIGHTxWIDTH in multiples of {SIZE_STEP_PX} pixels, such as 192x640",
                found=text,
            )
        return cls(*sides)

    def for_image(self, height_px: int, width_px: int) -> "InputSize":
        """Return a size of about as many pixels, with the aspect ratio of an image and in multiples of 32.

        >>> tuple(InputSize(192, 640).for_image(375, 1242)), tuple(InputSize(192, 640).for_image(900, 1600))
        ((192, 640), (256, 480))
        """
        aspect = width_px / height_px
        height = math.sqrt(self.height_px * self.width_px / aspect)
        rows = max(1, round(height / SIZE_STEP_PX))
        columns = max(1, round(aspect * height / SIZE_STEP_PX))
        return InputSize(SIZE_STEP_PX * rows, SIZE_STEP_PX * columns)


def stretch(image: UInt8, size: InputSize, modality: Modality) -> UInt8:
    """Return an (H, W, C) image stretched to the (h, w, C) of a size.

    Maps are resized by nearest neighbours: the mean of two depths is a position where nothing is.
    """
    height, width = image.shape[:2]
    if (height, width) == size:
        return image
    shrinks = size.height_px < height or size.width_px < width
    smooth = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    how = smooth if modality == "rgb" else cv2.INTER_NEAREST
    stretched = cv2.resize(image, (size.width_px, size.height_px), interpolation=how)
    return np.asarray(stretched, np.uint8).reshape(*size, -1)


def boxes_in_image(boxes_px: Float64, size: InputSize, image: UInt8) -> Float64:
    """Return (M, 4) boxes of the input scaled to the (H, W, C) image that was stretched to it."""
    height, width = image.shape[:2]
    scale = np.tile([width / size.width_px, height / size.height_px], 2)
    return np.asarray(boxes_px * scale, np.float64)
