"""Follow one object in the image alone; how it is found there is another's business."""

from typing import Protocol

import numpy as np

from perception.errors import PerceptionError
from perception.geometry.box_outline_px import box_outlines_px
from perception.tracking.single_object.point_model import check_start_box
from perception.tracking.single_object.tracker import TrackedObject, TrackerInput, TrackStatus
from perception.types import Boxes3D, Float64, UInt8


class ImageFinder(Protocol):
    """Remembers how an object looks, and finds it in the next image."""

    def init(self, image: UInt8, box_px: Float64) -> None:
        """Learn the object from its (4,) rectangle, which lies within the image; forget any before."""
        ...

    def find(self, image: UInt8) -> Float64 | None:
        """Return the (4,) rectangle of the object, or None where it is not seen."""
        ...


class ImageOnlyTracker:
    """Implements `SingleObjectTracker` without points: it gives no box in space and no velocity.

    It begins with the rectangle around the projected box, cut off at the image's borders. Where the image
    is missing, or the object is not found in it, the last rectangle is the guess.
    """

    def __init__(self, name: str, finder: ImageFinder, most_missed: int = 10) -> None:
        """Choose how the object is found.

        Args:
            name: of the tracker, for messages.
            finder: finds the object.
            most_missed: frames in a row without a sight of the object, after which it is lost.
        """
        self.name = name
        self._finder, self._most_missed = finder, most_missed
        self._box_px: Float64 | None = None
        self._missed = 0

    def start(self, tracker_input: TrackerInput, box_velo: Boxes3D) -> TrackedObject:
        """Begin with the object's box in the LiDAR frame of this moment; forget any object before.

        Raises:
            PerceptionError: the box is not one finite box of positive size, it is not in the image, or
                there is no image.
        """
        check_start_box(box_velo)
        if tracker_input.image is None or tracker_input.image_P_velo is None:
            raise PerceptionError(
                f"tracker {self.name}",
                expected="a first frame with a camera's image and its calibration",
                found="none",
                advice="choose a tracker that follows points",
            )
        height, width = tracker_input.image.shape[:2]
        box_px = box_outlines_px(tracker_input.image_P_velo, box_velo, (width, height))[0]
        if not np.isfinite(box_px).all():
            raise PerceptionError(
                f"tracker {self.name}",
                expected="a first box in view of the camera",
                found="one outside the image",
            )
        self._finder.init(tracker_input.image, box_px)
        self._box_px, self._missed = box_px, 0
        return self._report()

    def update(self, tracker_input: TrackerInput) -> TrackedObject:
        """Say where the object is at the next moment.

        Raises:
            PerceptionError: nothing has been started.
        """
        if self._box_px is None:
            raise PerceptionError(
                f"tracker {self.name}", expected="start before follow", found="no object"
            )
        found_px = None if tracker_input.image is None else self._finder.find(tracker_input.image)
        self._missed = 0 if found_px is not None else self._missed + 1
        self._box_px = self._box_px if found_px is None else found_px
        return self._report()

    def _report(self) -> TrackedObject:
        state = TrackStatus.SEEN if self._missed == 0 else TrackStatus.PREDICTED
        if self._missed > self._most_missed:
            state = TrackStatus.LOST
        return TrackedObject(state, None, np.zeros(2), self._box_px)
