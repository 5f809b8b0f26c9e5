"""Labelled objects of one frame and their motion."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Self

from perception.types import ArrayTable, Boxes3D, Calibration, Float64, Frame, Int


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
    def of(cls, frame: Frame, dont_care_px: Float64) -> Self | None:
        """Return the view of a frame's camera, or None where its image size is not known."""
        calibration = frame.calibration
        if calibration is None or calibration.image_size_px is None:
            return None
        return cls(calibration, calibration.image_size_px, dont_care_px)


@dataclass(frozen=True)
class FrameAnnotations:
    """Annotations of one frame.

    Attributes:
        objects: Labelled objects, in the area or not.
        view: Image in which they were labelled.
    """

    objects: LabelledObjects
    view: LabelledView
