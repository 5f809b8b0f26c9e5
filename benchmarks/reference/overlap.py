"""Overlap of two rectangles x1 y1 x2 y2, and of two upright prisms, for the reference implementations."""

import math
from collections.abc import Sequence
from dataclasses import dataclass


def area(box: Sequence[float]) -> float:
    """Return the area of a box, 0 where it is empty."""
    return max(box[2] - box[0], 0.0) * max(box[3] - box[1], 0.0)


def shared_area(a: Sequence[float], b: Sequence[float]) -> float:
    """Return the area of the intersection of two boxes."""
    return area([max(a[0], b[0]), max(a[1], b[1]), min(a[2], b[2]), min(a[3], b[3])])


def iou(a: Sequence[float], b: Sequence[float]) -> float:
    """Return the intersection over union of two boxes, 0 where they do not meet."""
    shared = shared_area(a, b)
    return shared / (area(a) + area(b) - shared) if shared else 0.0


Corner = tuple[float, float]


@dataclass(frozen=True)
class Prism:
    """Upright prism over a convex polygon.

    Attributes:
        corners: Corners of the polygon, counter-clockwise.
        low: Height of the bottom.
        high: Height of the top.
    """

    corners: Sequence[Corner]
    low: float = 0.0
    high: float = 1.0


def turned_rectangle(center: Corner, length: float, width: float, yaw_rad: float) -> list[Corner]:
    """Return the corners of a rectangle, its length along the heading."""
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    return [
        (center[0] + cos * x - sin * y, center[1] + sin * x + cos * y)
        for x, y in (
            (length / 2, width / 2),
            (-length / 2, width / 2),
            (-length / 2, -width / 2),
            (length / 2, -width / 2),
        )
    ]


def volume(prism: Prism) -> float:
    """Return the volume of a prism."""
    return _polygon_area(prism.corners) * (prism.high - prism.low)


def shared_volume(a: Prism, b: Prism) -> float:
    """Return the volume of the intersection, its polygon cut edge by edge.

    I. Sutherland, G. Hodgman, "Reentrant polygon clipping", Communications of the ACM 1974.
    """
    polygon = list(a.corners)
    for start, end in zip(b.corners, [*b.corners[1:], b.corners[0]], strict=True):
        polygon = _left_of(polygon, start, end)
    height = min(a.high, b.high) - max(a.low, b.low)
    return _polygon_area(polygon) * max(height, 0.0)


def _left_of(polygon: Sequence[Corner], start: Corner, end: Corner) -> list[Corner]:
    """Return the part of a polygon to the left of a line."""
    kept = []
    for place, corner in enumerate(polygon):
        before = polygon[place - 1]
        side, side_before = _side(start, end, corner), _side(start, end, before)
        if side * side_before < 0:
            share = side_before / (side_before - side)
            kept.append(
                (
                    before[0] + share * (corner[0] - before[0]),
                    before[1] + share * (corner[1] - before[1]),
                )
            )
        if side >= 0:
            kept.append(corner)
    return kept


def _side(start: Corner, end: Corner, point: Corner) -> float:
    """Return above 0 of a point to the left of a line, below 0 to the right."""
    along = end[0] - start[0], end[1] - start[1]
    return along[0] * (point[1] - start[1]) - along[1] * (point[0] - start[0])


def _polygon_area(corners: Sequence[Corner]) -> float:
    twice = sum(
        corners[place - 1][0] * y - corners[place - 1][1] * x
        for place, (x, y) in enumerate(corners)
    )
    return abs(twice) / 2
