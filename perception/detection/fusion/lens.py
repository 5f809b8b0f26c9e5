"""Directions of pixels: what lies at an angle looks the same to every camera, whatever its field of view."""

from dataclasses import dataclass

import numpy as np

from perception.types import Calibration, Float64

# Where nobody says: what a camera that looks ahead from a car mostly spans from side to side.
_USUAL_SPAN_RAD = np.deg2rad(80)


@dataclass(frozen=True)
class Lens:
    """A pinhole.

    Attributes:
        focal_px: focal length across and down.
        center_px: column and row of the optical axis.
    """

    focal_px: tuple[float, float]
    center_px: tuple[float, float]

    @classmethod
    def of(cls, calibration: Calibration) -> "Lens":
        """Return that of a calibrated camera."""
        rows = calibration.image_P_cam
        return cls((float(rows[0, 0]), float(rows[1, 1])), (float(rows[0, 2]), float(rows[1, 2])))

    @classmethod
    def usual(cls, size_px: tuple[int, int]) -> "Lens":
        """Return a guess for a picture of (width, height)."""
        width, height = size_px
        focal_px = width / 2 / float(np.tan(_USUAL_SPAN_RAD / 2))
        return cls((focal_px, focal_px), (width / 2, height / 2))

    def tangents(self, boxes_px: Float64) -> Float64:
        """Return (M, 4) boxes in tangents of the angles off the optical axis."""
        return np.asarray((boxes_px - np.tile(self.center_px, 2)) / np.tile(self.focal_px, 2))
