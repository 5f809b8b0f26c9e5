"""Overlap of boxes in the image, from above, and in space: what KITTI's three average precisions differ in.

The protocol is the same for all of them, with the limits on the height in the image, occlusion and truncation. Each
metric matches by its own overlap. As with the official tool, DontCare regions have no 3D box, so that a false positive
inside of one counts from above and in space.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Generic, TypeVar

import numpy as np

from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes, unknown_boxes
from perception.geometry.box_overlap import (
    areas_m2,
    paired_intersection_areas_m2,
    paired_intersection_volumes_m3,
    volumes_m3,
)
from perception.geometry.box_overlap_px import area_px, paired_intersection_px
from perception.types import Bool, Boxes3D, Float64

Rows = TrueBoxes | DetectedBoxes
Shapes = TypeVar("Shapes", Float64, Boxes3D)

_UNKNOWN = unknown_boxes(1)


@dataclass(frozen=True)
class OverlapMetric(Generic[Shapes]):
    """Overlap by which detections match objects.

    Attributes:
        name: Name in documents.
        heading: Name in tables.
        shapes: Function from M rows to their M boxes in the image or in 3D.
        sizes: Function from M boxes to their (M,) areas or volumes.
        intersections: Function from two times M boxes to the (M,) areas or volumes that those of a row share.
        are_known: Function from M rows to an (M,) mask of those with such a box. A class is measured where one of
            its detections has it; then all of them count.
        has_orientation: Whether the orientation is measured beside the precision.
    """

    name: str
    heading: str
    shapes: Callable[[Rows], Shapes]
    sizes: Callable[[Shapes], Float64]
    intersections: Callable[[Shapes, Shapes], Float64]
    are_known: Callable[[Rows], Bool]
    has_orientation: bool = False

    def ious(self, a: Shapes, b: Shapes) -> Float64:
        """Return (M,) intersection over union of each box with the one in the same row of b; 0 of no size."""
        shared = self.intersections(a, b)
        return _ratio(shared, self.sizes(a) + self.sizes(b) - shared)

    def shares(self, a: Shapes, b: Shapes) -> Float64:
        """Return (M,) which share of each box lies in the one in the same row of b."""
        return _ratio(self.intersections(a, b), self.sizes(a))


def _ratio(part: Float64, whole: Float64) -> Float64:
    return np.divide(part, whole, out=np.zeros(part.shape), where=whole > 0)


def _outlines(rows: Rows) -> Boxes3D:
    """Return boxes without negative sizes: from above, unknown ones are squares of 1 m that cover each other."""
    return replace(rows.boxes_3d, size_m=np.abs(rows.boxes_3d.size_m))


def _are_on_ground(rows: Rows) -> Bool:
    return np.asarray(_are_placed(rows)[:, :2].all(axis=1))


def _are_in_space(rows: Rows) -> Bool:
    return np.asarray(_are_placed(rows).all(axis=1))


def _are_placed(rows: Rows) -> Bool:
    """Return (M, 3) whether the place and the size of each box are known, by axis."""
    boxes = rows.boxes_3d
    return np.asarray((boxes.bottom_m != _UNKNOWN.bottom_m) & (boxes.size_m > 0))


IMAGE: OverlapMetric[Float64] = OverlapMetric(
    "image",
    "2D",
    shapes=attrgetter("boxes_px"),
    sizes=area_px,
    intersections=paired_intersection_px,
    are_known=lambda rows: np.asarray(rows.boxes_px[:, 0] >= 0),
    has_orientation=True,
)
BEV: OverlapMetric[Boxes3D] = OverlapMetric(
    "bev",
    "BEV",
    shapes=_outlines,
    sizes=areas_m2,
    intersections=paired_intersection_areas_m2,
    are_known=_are_on_ground,
)
SPACE: OverlapMetric[Boxes3D] = OverlapMetric(
    "3d",
    "3D",
    shapes=attrgetter("boxes_3d"),
    sizes=volumes_m3,
    intersections=paired_intersection_volumes_m3,
    are_known=_are_in_space,
)
