"""Rectangles from above around the returns of vehicles: the best of some sizes and positions along some directions."""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled
from perception.types import Float32, Float64, Int

LENGTH_STEPS = (-1.0, 0.0, 1.0)  # lengths that are tried, in deviations from the mean of the class
_EDGE_DEVIATION_PX = 2.0  # standard deviation of the sides of the 2D box
_EDGE_DEVIATION_SHARE = 0.07  # increase of the same, as a share of the box's width
_HIDDEN_SIDE_COST = 4.0  # cost of a box whose side towards the sensor is not observed
_CENTERED_COST = 2.0  # cost of a box that extends beyond both ends of the points
_MIN_DEPTH_M = 0.1

_ROWS_32, _ROWS = array_of(np.float32, 2), array_of(np.float64, 2)
_ENDS, _NUMBERS = array_of(np.float32, 3), array_of(np.float64)


@compiled((WHOLE, NUMBER, NUMBER, NUMBER))
def _place(position: int, low_m: float, high_m: float, size_m: float) -> tuple[float, float]:
    """Return centre and cost of a box at the low end of the points, centred on them, or at the high end."""
    if position == 0:
        return low_m + size_m / 2, _HIDDEN_SIDE_COST if high_m < 0 else 0.0
    if position == 2:
        return high_m - size_m / 2, _HIDDEN_SIDE_COST if low_m > 0 else 0.0
    return (low_m + high_m) / 2, _CENTERED_COST if low_m > 0 or high_m < 0 else 0.0


@compiled((NUMBER, NUMBER, _NUMBERS, _NUMBERS))
def _size_cost(length_m: float, width_m: float, length: Float64, width: Float64) -> float:
    """Return the cost of a size by mean and deviation of length and width."""
    off_length, off_width = (length_m - length[0]) / length[1], (width_m - width[0]) / width[1]
    return float(off_length * off_length + off_width * off_width)


@compiled((_NUMBERS, _ROWS, _NUMBERS, NUMBER))
def _span_cost(middle: Float64, half: Float64, left_right_px: Float64, width_px: float) -> float:
    """Return the cost of the difference between the projected box and the 2D box, which ends at the image's sides.

    Args:
        middle: (2,) column times depth, and depth, of the centre.
        half: (2, 2) change of both by half a length along, and to the left.
        left_right_px: (2,) columns of the 2D box.
        width_px: Width of the image.
    """
    low_px, high_px = np.inf, -np.inf
    for along in (-1.0, 1.0):
        for left in (-1.0, 1.0):
            depth_m = middle[1] + along * half[1, 0] + left * half[1, 1]
            column = middle[0] + along * half[0, 0] + left * half[0, 1]
            column /= max(depth_m, _MIN_DEPTH_M)
            low_px, high_px = min(low_px, column), max(high_px, column)
    off_left = min(max(low_px, 0.0), width_px - 1) - left_right_px[0]
    off_right = min(max(high_px, 0.0), width_px - 1) - left_right_px[1]
    deviation_px = _EDGE_DEVIATION_PX
    deviation_px += _EDGE_DEVIATION_SHARE * (left_right_px[1] - left_right_px[0])
    return float((off_left * off_left + off_right * off_right) / deviation_px**2)


@compiled((_ROWS_32, _ENDS, _ENDS, _ROWS_32, (_ROWS, _ROWS), (_ROWS, _ROWS, NUMBER, _NUMBERS)))
def best_rectangles(
    yaw_rad: Float32,
    low_m: Float32,
    high_m: Float32,
    costs: Float32,
    sizes: tuple[Float64, Float64],
    spans: tuple[Float64, Float64, float, Float64],
) -> tuple[Int, Float64, Float64]:
    """Find the best of all directions, sizes and positions of each of F vehicles.

    Args:
        yaw_rad: (F, T) directions.
        low_m: (F, T, 2) lowest coordinates of the points along each and to the left of it.
        high_m: (F, T, 2) highest coordinates.
        costs: (F, T) costs of the directions.
        sizes: (F, 2) mean and deviation of the length, and of the width.
        spans: (F, 2) left and right column, (3, 4) projection, width of the image, (F,) height of the middle.

    Returns:
        (F, 2) the direction, and 1 where the length is across it; (F, 2) centres and (F, 2) sizes along and left.
    """
    (lengths, widths), (columns_px, P, width_px, heights_m) = sizes, spans
    count, directions = yaw_rad.shape
    chosen, centers_m = np.zeros((count, 2), np.int64), np.zeros((count, 2))
    sizes_m, per_m, half = np.zeros((count, 2)), np.zeros((2, 2)), np.zeros((2, 2))
    middle = np.zeros(2)
    for f in range(count):
        best = np.inf
        for t in range(directions):
            cos, sin = np.cos(yaw_rad[f, t]), np.sin(yaw_rad[f, t])
            for u in range(2):
                per_m[u, 0] = P[2 * u, 0] * cos + P[2 * u, 1] * sin
                per_m[u, 1] = P[2 * u, 1] * cos - P[2 * u, 0] * sin
            low, high = low_m[f, t], high_m[f, t]
            for option in range(2 * len(LENGTH_STEPS)):
                across = option // len(LENGTH_STEPS)
                length_m = lengths[f, 0] + LENGTH_STEPS[option % len(LENGTH_STEPS)] * lengths[f, 1]
                length_m = max(length_m, np.float64(high[across] - low[across]))
                width_m = max(widths[f, 0], np.float64(high[1 - across] - low[1 - across]))
                along_m, left_m = (width_m, length_m) if across == 1 else (length_m, width_m)
                size_cost = costs[f, t] + _size_cost(length_m, width_m, lengths[f], widths[f])
                for u in range(2):
                    half[u, 0], half[u, 1] = per_m[u, 0] * along_m / 2, per_m[u, 1] * left_m / 2
                for i in range(9):
                    x, x_cost = _place(i // 3, low[0], high[0], along_m)
                    y, y_cost = _place(i % 3, low[1], high[1], left_m)
                    cost = size_cost + x_cost + y_cost
                    if cost >= best:
                        continue
                    for u in range(2):
                        middle[u] = per_m[u, 0] * x + per_m[u, 1] * y
                        middle[u] += P[2 * u, 2] * heights_m[f] + P[2 * u, 3]
                    cost += _span_cost(middle, half, columns_px[f], width_px)
                    if cost < best:
                        best = cost
                        chosen[f, 0], chosen[f, 1] = t, across
                        centers_m[f, 0], centers_m[f, 1] = x, y
                        sizes_m[f, 0], sizes_m[f, 1] = along_m, left_m
    return chosen, centers_m, sizes_m
