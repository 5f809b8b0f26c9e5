"""Trackers of one object in the image alone, and OpenCV's trackers behind that interface.

The headless OpenCV wheel has one tracker that needs no network: MIL. KCF and CSRT are in the wheel with contributed
modules. DaSiamRPN, GOTURN, Nano and Vit need trained networks, which no wheel holds and which are not shipped.
"""

from typing import Any, Protocol

import cv2
import numpy as np

from perception.errors import PerceptionError, UsageError
from perception.tracking.single_object.tracker import (
    TrackedObject,
    TrackerInput,
    TrackStatus,
    not_initialized,
    validate_initial_box,
)
from perception.types import Boxes3D, Float64, UInt8


class ImageFinder(Protocol):
    """Learns the appearance of an object, and finds it in the next image."""

    def init(self, image: UInt8, box_px: Float64) -> None:
        """Learn the object from its (4,) box, which lies within the image; forget any object before."""
        ...

    def find(self, image: UInt8) -> Float64 | None:
        """Return the (4,) box of the object, or None where it is not found."""
        ...


class ImageOnlyTracker:
    """A `SingleObjectTracker` without points: it gives no box in space and no velocity.

    It starts with the outline of the projected box, cut off at the image's borders. Where the image is missing, or the
    object is not found in it, the last box is the estimate.
    """

    def __init__(self, name: str, finder: ImageFinder, max_missed: int = 10) -> None:
        """Create a tracker without an object.

        Args:
            name: Name of the tracker, for messages.
            finder: Finds the object.
            max_missed: Maximum number of consecutive frames without the object, after which it is lost.
        """
        self.name = name
        self._finder, self._max_missed = finder, max_missed
        self._box_px: Float64 | None = None
        self._missed = 0

    def init(self, tracker_input: TrackerInput, box_velo: Boxes3D) -> TrackedObject:
        """Initialize the tracker with the object's box.

        Raises:
            PerceptionError: The box is not one finite box of positive size, it is not in the image, or there
                is no image.
        """
        validate_initial_box(box_velo)
        if tracker_input.image is None or tracker_input.image_P_velo is None:
            raise PerceptionError(
                f"tracker {self.name}",
                expected="an image and a camera calibration in the first frame",
                found="none",
                advice="choose a tracker that uses points",
            )
        box_px = tracker_input.box_px(box_velo)
        if box_px is None:
            raise PerceptionError(
                f"tracker {self.name}",
                expected="an initial box in view of the camera",
                found="one outside the image",
            )
        self._finder.init(tracker_input.image, box_px)
        self._box_px, self._missed = box_px, 0
        return self._tracked(box_px)

    def update(self, tracker_input: TrackerInput) -> TrackedObject:
        """Track the object into the next frame.

        Raises:
            PerceptionError: The tracker has not been initialized.
        """
        if self._box_px is None:
            raise not_initialized(f"tracker {self.name}")
        image = tracker_input.image
        found_px = None if image is None else self._finder.find(image)
        self._missed = 0 if found_px is not None else self._missed + 1
        self._box_px = self._box_px if found_px is None else found_px
        return self._tracked(self._box_px)

    def _tracked(self, box_px: Float64) -> TrackedObject:
        status = TrackStatus.SEEN if self._missed == 0 else TrackStatus.PREDICTED
        if self._missed > self._max_missed:
            status = TrackStatus.LOST
        return TrackedObject(status, None, np.zeros(2), box_px)


# Name of each tracker, and its class in OpenCV.
OPENCV_TRACKERS = {
    "opencv-mil": "TrackerMIL",
    "opencv-kcf": "TrackerKCF",
    "opencv-csrt": "TrackerCSRT",
}
# MIL learns from windows beside the object and fails on an image without room for them; on fewer pixels it
# never returns.
_MIN_SIDE_PX, _ROOM_PX = 8, 16


def missing_opencv_trackers() -> frozenset[str]:
    """Return the names of the trackers that the installed OpenCV lacks."""
    return frozenset(name for name in OPENCV_TRACKERS if _factory(name) is None)


def opencv_tracker(name: str, max_missed: int = 10) -> ImageOnlyTracker:
    """Return one of `OPENCV_TRACKERS`.

    Raises:
        UsageError: The installed OpenCV lacks it.
    """
    factory = _factory(name)
    if factory is None:
        raise UsageError(
            f"tracker {name}",
            expected=f"an OpenCV with {OPENCV_TRACKERS[name]}",
            found=f"OpenCV {cv2.__version__} without it",
            advice="install opencv-contrib-python-headless in place of opencv-python-headless",
        )
    return ImageOnlyTracker(name, OpenCvFinder(factory), max_missed)


class OpenCvFinder:
    """A tracker of OpenCV as an `ImageFinder`.

    MIL draws random numbers from generators of the C library and of OpenCV that a process has but once: the same run
    gives the same boxes, but a second run in one process may differ by a few pixels.
    """

    def __init__(self, factory: Any) -> None:  # noqa: ANN401  (OpenCV names no common type)
        """Choose the tracker by the function that creates one."""
        self._factory = factory

    def init(self, image: UInt8, box_px: Float64) -> None:
        """Start a new tracker on the box, or on a window around it that OpenCV can work with."""
        window = _workable_window(box_px, image)
        self._share = (box_px.reshape(2, 2) - window[:2]) / window[2:]
        self._tracker = self._factory()
        self._tracker.init(_as_bgr(image), window)

    def find(self, image: UInt8) -> Float64 | None:
        """Update the tracker; the box moves and grows as the tracker's window does."""
        is_found, window = self._tracker.update(_as_bgr(image))
        if not is_found or not np.isfinite(window).all():
            return None
        return np.asarray(self._share * window[2:] + window[:2]).ravel()


def _factory(name: str) -> Any:  # noqa: ANN401
    return getattr(cv2, f"{OPENCV_TRACKERS[name]}_create", None)


def _workable_window(box_px: Float64, image: UInt8) -> tuple[int, int, int, int]:
    """Return column, row, width and height of a window like a box, neither tiny nor all of the image."""
    size_px = np.array(image.shape[1::-1])
    side_px = np.rint(box_px[2:] - box_px[:2])
    side_px = np.minimum(np.maximum(side_px, _MIN_SIDE_PX), size_px - _ROOM_PX)
    low_px = np.clip((box_px[:2] + box_px[2:] - side_px) / 2, 0, size_px - side_px)
    column, row, width, height = np.rint(np.concatenate([low_px, side_px])).astype(int).tolist()
    return column, row, width, height


def _as_bgr(image: UInt8) -> UInt8:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
