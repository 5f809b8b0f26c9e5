"""Labelled objects of one frame, their motion, and the image in which they were labelled."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Self

import numpy as np

from perception.geometry.camera import is_in_view, project
from perception.types import ArrayTable, Bool, Boxes3D, Calibration, Float, Float64, Int

_LENGTHS_M = {"under 2 m": (0.0, 2.0), "2 to 6 m": (2.0, 6.0), "over 6 m": (6.0, np.inf)}


class MotionState(IntEnum):
    """Motion of a labelled object at one moment."""

    UNKNOWN = 0  # too short a track, or a speed that the labels cannot distinguish from zero
    STATIC = 1
    MOVING = 2


@dataclass(frozen=True)
class LabelledObjects(ArrayTable):
    """M labelled objects of one frame.

    Attributes:
        boxes_velo: (M) 3D boxes in the LiDAR frame.
        motions: (M,) `MotionState` of each object.
        track_ids: (M,) Track id, -1 where the labels have no tracks.
    """

    boxes_velo: Boxes3D
    motions: Int
    track_ids: Int


@dataclass(frozen=True)
class LabelledView:
    """Image in which objects were labelled.

    Attributes:
        calibration: Calibration of the camera.
        image_size_px: Image size (width, height) in px.
        dont_care_px: (D, 4) Regions x1 y1 x2 y2 without labels.
    """

    calibration: Calibration
    image_size_px: tuple[int, int]
    dont_care_px: Float64

    @classmethod
    def of(cls, calibration: Calibration | None, dont_care_px: Float64) -> Self | None:
        """Return the view of a camera, or None where its image size is not known."""
        if calibration is None or calibration.image_size_px is None:
            return None
        return cls(calibration, calibration.image_size_px, dont_care_px)

    def contains(self, points_velo: Float) -> Bool:
        """Tell which (N, 3+) points fall inside the image."""
        return is_in_view(self.calibration, points_velo, self.image_size_px)

    def is_dont_care(self, points_velo: Float) -> Bool:
        """Tell which (N, 3+) points fall in a DontCare region."""
        pixels, _ = project(self.calibration.image_P_velo, points_velo)
        low, high = self.dont_care_px[:, None, :2], self.dont_care_px[:, None, 2:]
        with np.errstate(invalid="ignore"):
            return np.asarray(((pixels >= low) & (pixels <= high)).all(axis=2).any(axis=0))


def length_classes(lengths_m: Float64) -> dict[str, Bool]:
    """Return which of (M,) objects belong to each class of lengths, by its name: persons, cars, long vehicles."""
    return {
        name: np.asarray((lengths_m >= low_m) & (lengths_m < high_m))
        for name, (low_m, high_m) in _LENGTHS_M.items()
    }


def raised_boxes(boxes: Boxes3D, clearance_m: float) -> Boxes3D:
    """Return boxes without their lowest part, in which points may be ground."""
    lift_m = np.array([0.0, 0.0, clearance_m])
    return Boxes3D(boxes.bottom_m + lift_m, boxes.size_m - lift_m, boxes.yaw_rad)
