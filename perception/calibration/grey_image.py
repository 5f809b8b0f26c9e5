"""A grey image with its projection, at any size."""

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from perception.types import Calibration, Float64, UInt8

_ABOUT_WHOLE, _ABOUT_BLOCK = 0.95, 0.03


@dataclass(frozen=True)
class GreyImage:
    """Grey image with its projection.

    Attributes:
        grey: (H, W) image.
        image_P_cam: (3, 4) projection to its pixels.
    """

    grey: UInt8
    image_P_cam: Float64

    @classmethod
    def of(cls, image: UInt8, calibration: Calibration, max_focal_px: float) -> Self:
        """Return an image in grey.

        Args:
            image: (H, W, 3) RGB image.
            calibration: Calibration of the camera.
            max_focal_px: Focal length above which the image is made smaller.
        """
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8)
        whole = cls(grey, calibration.image_P_cam)
        return whole.shrunk(max_focal_px / float(calibration.image_P_cam[0, 0]))

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        return self.grey.shape[1], self.grey.shape[0]

    def shrunk(self, scale: float) -> Self:
        """Return the image at about a share of its size, as it is where that is about its own.

        Where whole blocks of pixels become one, as at a half, the rows and columns beyond the last block are left out: it is
        ten times as fast.
        """
        if scale > _ABOUT_WHOLE:
            return self
        grey, block = self.grey, round(1 / scale)
        if abs(block * scale - 1) < _ABOUT_BLOCK:
            width, height = (length // block * block for length in self.size_px)
            grey = grey[:height, :width]
            scale = 1 / block
        size_px = tuple(max(round(scale * length), 2) for length in grey.shape[::-1])
        smaller = np.asarray(cv2.resize(grey, size_px, interpolation=cv2.INTER_AREA), np.uint8)
        image_P_cam = self.image_P_cam.copy()
        # Pixel centres are whole numbers: those of a smaller image lie between them.
        shares = np.divide(size_px, grey.shape[::-1])[:, None]
        image_P_cam[:2] = (image_P_cam[:2] + image_P_cam[2] / 2) * shares - image_P_cam[2] / 2
        return type(self)(smaller, image_P_cam)
