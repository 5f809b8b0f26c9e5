"""The trackers of one object that OpenCV brings, behind the one interface.

The headless wheel brings one that needs no network: MIL. KCF and CSRT are in the wheel with contributed
modules. DaSiamRPN, GOTURN, Nano and Vit need the files of trained networks, which no wheel holds and which
this suite does not ship.
"""

from typing import Any

import cv2
import numpy as np

from perception.errors import UsageError
from perception.tracking.single_object.baselines.image_only_tracker import ImageOnlyTracker
from perception.types import Float64, UInt8

# The name of each, and what OpenCV calls it.
OPENCV_TRACKERS = {
    "opencv-mil": "TrackerMIL",
    "opencv-kcf": "TrackerKCF",
    "opencv-csrt": "TrackerCSRT",
}
# MIL learns from windows beside the object and refuses an image without room for them; on fewer pixels it
# never returns.
_MIN_SIDE_PX, _ROOM_PX = 8, 16


def missing_opencv_trackers() -> frozenset[str]:
    """Return the names of those that the OpenCV that is installed does not bring."""
    return frozenset(name for name in OPENCV_TRACKERS if _maker(name) is None)


def opencv_tracker(name: str) -> ImageOnlyTracker:
    """Make one of `OPENCV_TRACKERS`.

    Raises:
        UsageError: the OpenCV that is installed does not bring it.
    """
    maker = _maker(name)
    if maker is None:
        raise UsageError(
            f"tracker {name}",
            expected=f"an OpenCV with {OPENCV_TRACKERS[name]}",
            found=f"OpenCV {cv2.__version__} without it",
            advice="install opencv-contrib-python-headless in place of opencv-python-headless",
        )
    return ImageOnlyTracker(name, OpenCvFinder(maker))


class OpenCvFinder:
    """Lets a tracker of OpenCV find the object; implements `ImageFinder`.

    MIL draws numbers from generators of the C library and of OpenCV that a process has but once: the same
    run gives the same answers, but an object followed again within it may be found a few pixels elsewhere.
    """

    def __init__(self, maker: Any) -> None:  # noqa: ANN401  (OpenCV names no common type)
        """Choose which, by the function that makes one."""
        self._maker = maker

    def init(self, image: UInt8, box_px: Float64) -> None:
        """Start a new tracker on the rectangle, or on a window around it that OpenCV can work with."""
        window = _workable_window(box_px, image)
        self._share = (box_px.reshape(2, 2) - window[:2]) / window[2:]
        self._tracker = self._maker()
        self._tracker.init(_as_bgr(image), window)

    def find(self, image: UInt8) -> Float64 | None:
        """Let the tracker find it; the rectangle moves and grows as the tracker's window does."""
        is_found, window = self._tracker.update(_as_bgr(image))
        if not is_found or not np.isfinite(window).all():
            return None
        return np.asarray(self._share * window[2:] + window[:2]).ravel()


def _maker(name: str) -> Any:  # noqa: ANN401
    return getattr(cv2, f"{OPENCV_TRACKERS[name]}_create", None)


def _workable_window(box_px: Float64, image: UInt8) -> tuple[int, int, int, int]:
    """Return column, row, width and height of a window like a rectangle, neither tiny nor all the image."""
    size_px = np.array(image.shape[1::-1])
    side_px = np.rint(box_px[2:] - box_px[:2])
    side_px = np.minimum(np.maximum(side_px, _MIN_SIDE_PX), size_px - _ROOM_PX)
    low_px = np.clip((box_px[:2] + box_px[2:] - side_px) / 2, 0, size_px - side_px)
    column, row, width, height = np.rint(np.concatenate([low_px, side_px])).astype(int).tolist()
    return column, row, width, height


def _as_bgr(image: UInt8) -> UInt8:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
