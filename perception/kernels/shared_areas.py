"""Area that two turned rectangles on the ground share."""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled
from perception.types import Float64

_RECTANGLES = array_of(NUMBER, 2)
_FLAT_M = 1e-9  # an edge that rises less across the rectangle is level
_NO_AREA_M2 = 1e-9  # a smaller sum is rounding: rectangles that lie apart share nothing


@compiled((NUMBER, NUMBER))
def _clamped_integral(y: float, limit: float) -> float:
    """Return the integral of clamp(y, -limit, limit) from 0 to y."""
    inside = min(abs(y), limit)
    return inside**2 / 2 + limit * (abs(y) - inside)


@compiled((NUMBER, NUMBER, NUMBER))
def _mean_clamped(start: float, end: float, limit: float) -> float:
    """Return the mean of clamp(y, -limit, limit) for y from start to end."""
    if abs(end - start) <= _FLAT_M:
        return min(max((start + end) / 2, -limit), limit)
    area = _clamped_integral(end, limit) - _clamped_integral(start, limit)
    return float(area / (end - start))


@compiled((_RECTANGLES,))
def _radii(rectangles: Float64) -> Float64:
    """Return the (M,) radii of the circles around (M, 5) rectangles."""
    return np.sqrt(rectangles[:, 2] ** 2 + rectangles[:, 3] ** 2) / 2


@compiled((_RECTANGLES, WHOLE, _RECTANGLES, WHOLE, NUMBER))
def _shared_area(a: Float64, row: int, b: Float64, other: int, reach: float) -> float:
    """Return the area that lies under a rectangle of (A, 5) and one of (B, 5); NaN where one is.

    In the frame of b, seen along its width, a is a heap of slices: what a slice shares with b is its upper end less its
    lower one, each clamped to b's sides. The edges of a are these ends, so the area is the sum, over the edges, of the
    integral of a clamped straight line; each has a closed form, and no polygon has to be cut. Circles around them that do
    not meet, at the sum of their radii, decide most pairs.
    """
    x, y = a[row, 0] - b[other, 0], a[row, 1] - b[other, 1]
    apart2 = x * x + y * y
    if not apart2 <= reach * reach:
        return 0.0 if apart2 > reach * reach else np.nan
    cos, sin = np.cos(b[other, 4]), np.sin(b[other, 4])
    x, y = cos * x + sin * y, cos * y - sin * x
    half_length, half_width = b[other, 2] / 2, b[other, 3] / 2
    cos, sin = np.cos(a[row, 4] - b[other, 4]), np.sin(a[row, 4] - b[other, 4])
    ahead_x, ahead_y = cos * a[row, 2] / 2, sin * a[row, 2] / 2
    left_x, left_y = -sin * a[row, 3] / 2, cos * a[row, 3] / 2
    area = 0.0
    # Corners run counter-clockwise: the upper ends are met from right to left.
    x0, y0 = x + ahead_x + left_x, y + ahead_y + left_y
    for ahead, left in ((-1, 1), (-1, -1), (1, -1), (1, 1)):
        x1, y1 = x + ahead * ahead_x + left * left_x, y + ahead * ahead_y + left * left_y
        slope = (y1 - y0) / (x1 - x0) if abs(x1 - x0) > _FLAT_M else 0.0
        begin = min(max(x0, -half_length), half_length)
        end = min(max(x1, -half_length), half_length)
        start_y, end_y = y0 + (begin - x0) * slope, y0 + (end - x0) * slope
        area += (begin - end) * _mean_clamped(start_y, end_y, half_width)
        x0, y0 = x1, y1
    return 0.0 if area < _NO_AREA_M2 else area


@compiled((_RECTANGLES, _RECTANGLES))
def shared_areas(a: Float64, b: Float64) -> Float64:
    """Return (A, B) the areas that lie under both of (A, 5) and (B, 5) rectangles x, y, length, width, heading."""
    areas, of_a, of_b = np.empty((len(a), len(b))), _radii(a), _radii(b)
    for row in range(len(a)):
        for other in range(len(b)):
            areas[row, other] = _shared_area(a, row, b, other, of_a[row] + of_b[other])
    return areas


@compiled((_RECTANGLES, _RECTANGLES))
def paired_shared_areas(a: Float64, b: Float64) -> Float64:
    """Return (M,) the area that lies under each rectangle and the one in the same row of b."""
    areas, reaches = np.empty(len(a)), _radii(a) + _radii(b)
    for row in range(len(a)):
        areas[row] = _shared_area(a, row, b, row, reaches[row])
    return areas
