"""Coverage: how many of the true objects that some detector has found have ever had an id."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from perception.evaluation.report import Metric, Metrics
from perception.geometry.box_overlap_px import iou_px
from perception.types import Bool, Float64, Int

MIN_FRAMES = 3  # in which an object that should have an id is detected
_MIN_IOU = 0.5


@dataclass(frozen=True)
class CoverageMetrics(Metrics):
    """Coverage of the objects of a range.

    Attributes:
        detected: Number of objects that some detector found in enough frames.
        tracked: Share of these that have had an id.
    """

    detected: Annotated[int, Metric("detected")]
    tracked: Annotated[float, Metric("with an id", ".3f")]


@dataclass(frozen=True)
class _Detected:
    frames: int = 0
    nearest_m: float = float("inf")
    is_tracked: bool = False


class Coverage:
    """Counts in how many frames true objects are detected, and whether they are ever tracked."""

    def __init__(self) -> None:
        self._objects: dict[int, _Detected] = {}

    def update(
        self,
        ids: Int,
        boxes_px: Float64,
        range_m: Float64,
        views_px: Iterable[Float64],
        tracked_px: Float64,
    ) -> None:
        """Add one frame.

        Args:
            ids: (G,) ids of the true objects.
            boxes_px: (G, 4) their boxes in the image.
            range_m: (G,) their distances.
            views_px: (M, 4) boxes in the image of each detector.
            tracked_px: (T, 4) boxes in the image of what has an id.
        """
        is_detected = np.zeros(len(ids), bool)
        for found_px in views_px:
            is_detected |= _is_found(boxes_px, found_px)
        is_tracked = _is_found(boxes_px, tracked_px)
        for row in np.flatnonzero(is_detected | is_tracked).tolist():
            known = self._objects.get(int(ids[row]), _Detected())
            self._objects[int(ids[row])] = _Detected(
                known.frames + int(is_detected[row]),
                min(known.nearest_m, float(range_m[row])),
                known.is_tracked or bool(is_tracked[row]),
            )

    def compute(self, low_m: float, high_m: float) -> CoverageMetrics:
        """Return the coverage of the objects that were nearest within a range."""
        tracked = [
            one.is_tracked
            for one in self._objects.values()
            if one.frames >= MIN_FRAMES and low_m <= one.nearest_m < high_m
        ]
        return CoverageMetrics(len(tracked), float(np.mean(tracked)) if tracked else float("nan"))


def _is_found(boxes_px: Float64, found_px: Float64) -> Bool:
    return np.asarray(iou_px(boxes_px, found_px).max(axis=1, initial=0.0) >= _MIN_IOU)
