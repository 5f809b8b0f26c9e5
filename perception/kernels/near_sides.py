"""Axes and near sides of vehicles seen from above, by their returns."""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled
from perception.types import Float32, Float64, Int

_F32, _ROWS = np.float32, array_of(np.float64, 2)
_BIN_M = 2.0  # edge of the cells by which the returns of a box are found
_ABOVE_M = 0.1  # over a box in which returns are its own
_MIN_SINE = 0.15  # of the angle at which a side is seen
_INSIDE = 0.97  # share of the returns within an edge
_STEP_RAD, _STEPS = np.radians(3.0), 5  # between turns that are tried, number on either side
_SAMPLES = 64  # maximum number of returns by which they are compared
_SIDE_NOISE_M = 0.15  # standard deviation of returns from their side
_MAX_OFF_M = 0.4  # from a side, beyond which a return costs no more
_WEIGHT = 12.0  # number of independent observations that all returns together are worth
_OTHERS_SHARE = 0.1  # probability that the returns are another object's


@compiled((array_of(_F32, 2), array_of(_F32), NUMBER, WHOLE))
def _rows_by_bin(points: Float32, heights_m: Float32, low_m: float, side: int) -> tuple[Int, Int]:
    """Return the rows of the points above a height in the order of square bins, and where each bin begins, and the last ends."""
    bin_of, firsts = np.full(len(points), -1, np.int32), np.zeros(side * side + 1, np.int64)
    for k in range(len(points)):
        i, j = int(points[k, 0] / _BIN_M + side / 2), int(points[k, 1] / _BIN_M + side / 2)
        if heights_m[k] > low_m and 0 <= i < side and 0 <= j < side:
            bin_of[k] = i * side + j
            firsts[bin_of[k] + 1] += 1
    firsts = np.cumsum(firsts)
    rows, filled = np.empty(firsts[-1], np.int64), firsts.copy()
    for k in range(len(points)):
        if bin_of[k] >= 0:
            rows[filled[bin_of[k]]] = k
            filled[bin_of[k]] += 1
    return rows, firsts


@compiled((_ROWS, NUMBER))
def _turned(places_m: Float64, turn_rad: float) -> Float64:
    """Return (2, N) places along and across axes that are turned."""
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    turned_m = np.empty(places_m.shape)
    for n in range(places_m.shape[1]):
        along_m, across_m = places_m[0, n], places_m[1, n]
        turned_m[0, n] = cos * along_m + sin * across_m
        turned_m[1, n] = cos * across_m - sin * along_m
    return turned_m


@compiled((_ROWS, _ROWS))
def _edges(places_m: Float64, sensor_m: Float64) -> Float64:
    """Return (2,) how far (2, N) places reach towards the (2, 1) place of the sensor, NaN at a grazing angle."""
    edges_m = np.full(2, np.nan)
    last = int(_INSIDE * (places_m.shape[1] - 1))
    for axis in range(2):
        if abs(sensor_m[axis, 0]) >= _MIN_SINE * np.hypot(sensor_m[0, 0], sensor_m[1, 0]):
            towards_m = np.sign(sensor_m[axis, 0]) * places_m[axis]
            edges_m[axis] = np.partition(towards_m, last)[last]
    return edges_m


@compiled((_ROWS, _ROWS))
def _side_cost(places_m: Float64, sensor_m: Float64) -> float:
    """Return the cost of returns that lie on no side that faces the sensor."""
    edges_m, cost, count = _edges(places_m, sensor_m), 0.0, places_m.shape[1]
    for n in range(count):
        off_m = _MAX_OFF_M
        for axis in range(2):
            towards_m = np.sign(sensor_m[axis, 0]) * places_m[axis, n]
            off_m = np.fmin(off_m, abs(towards_m - edges_m[axis]))
        cost += (off_m / _SIDE_NOISE_M) ** 2
    return float(_WEIGHT * cost / count)


@compiled((array_of(NUMBER), array_of(NUMBER)))
def _moments(turns_rad: Float64, costs: Float64) -> tuple[float, float]:
    """Return mean and variance of turns by their costs, with that of the turns between."""
    shares = np.exp((costs.min() - costs) / 2)
    shares /= shares.sum()
    mean_rad = (shares * turns_rad).sum()
    return mean_rad, (shares * (turns_rad - mean_rad) ** 2).sum() + _STEP_RAD**2 / 12


@compiled((_ROWS, _ROWS, NUMBER))
def _likely_turn(places_m: Float64, sensor_m: Float64, deviation_rad: float) -> tuple[float, float]:
    """Return mean and standard deviation of the turn at which returns lie on near sides, by what is known of it before.

    Where it may turn farther than is tried, the deviation gets less by the share by which it does within. Returns of another
    object tell nothing of it.
    """
    turns_rad = _STEP_RAD * np.arange(-_STEPS, _STEPS + 1)
    costs = (turns_rad / deviation_rad) ** 2
    _, before = _moments(turns_rad, costs)
    for t, turn_rad in enumerate(turns_rad):
        costs[t] += _side_cost(_turned(places_m, turn_rad), _turned(sensor_m, turn_rad))
    mean_rad, after = _moments(turns_rad, costs)
    left = _OTHERS_SHARE + (1 - _OTHERS_SHARE) * min(after / before, 1.0)
    return mean_rad, deviation_rad * np.sqrt(left)


@compiled((array_of(_F32, 2), array_of(_F32), _ROWS, array_of(NUMBER), NUMBER, NUMBER, WHOLE))
def near_sides(
    points: Float32,
    heights_m: Float32,
    boxes: Float64,
    axis_rad: Float64,
    low_m: float,
    margin_m: float,
    least: int,
) -> Float64:
    """Return (M, 4) the turn of each box to its returns, its deviation, and how far these reach along and across it.

    The latter are from its middle towards the sensor, NaN where there are few returns, and of a side that is seen at a
    grazing angle. A box of few returns is not turned.

    Args:
        points: (N, 4) points in the sensor's frame.
        heights_m: (N,) heights above the ground.
        boxes: (M, 7) x, y and height of the bottom, length, width, height, heading.
        axis_rad: (M,) standard deviations of the headings modulo pi.
        low_m: Height from which a return counts.
        margin_m: Length by which boxes are grown to the sides.
        least: Number of returns from which a box is measured.
    """
    sides = np.full((len(boxes), 4), np.nan)
    sides[:, 0], sides[:, 1] = 0.0, axis_rad
    if len(boxes) == 0:
        return sides
    reach_m = np.abs(boxes[:, :2]).max() + boxes[:, 3:5].max() + margin_m
    side = 2 * int(reach_m / _BIN_M) + 3
    rows, firsts = _rows_by_bin(points, heights_m, low_m, side)
    places_m = np.empty((2, len(rows)))
    for m in range(len(boxes)):
        x, y, top_m = boxes[m, 0], boxes[m, 1], boxes[m, 2] + boxes[m, 5] + _ABOVE_M
        cos, sin = np.cos(boxes[m, 6]), np.sin(boxes[m, 6])
        half_m = boxes[m, 3:5] / 2 + margin_m
        around_m, count = np.hypot(half_m[0], half_m[1]), 0
        low_i, high_i = (x - around_m) / _BIN_M + side / 2, (x + around_m) / _BIN_M + side / 2
        low_j, high_j = (y - around_m) / _BIN_M + side / 2, (y + around_m) / _BIN_M + side / 2
        for i in range(int(low_i), int(high_i) + 1):
            for k in rows[firsts[i * side + int(low_j)] : firsts[i * side + int(high_j) + 1]]:
                dx, dy = points[k, 0] - x, points[k, 1] - y
                along_m, across_m = cos * dx + sin * dy, cos * dy - sin * dx
                is_in = abs(along_m) < half_m[0] and abs(across_m) < half_m[1]
                if is_in and heights_m[k] < top_m:
                    places_m[0, count], places_m[1, count] = along_m, across_m
                    count += 1
        if count < least:
            continue
        sensor_m = np.array([[-(cos * x + sin * y)], [sin * x - cos * y]])
        stride = (count - 1) // _SAMPLES + 1
        samples_m = places_m[:, :count:stride].copy()
        sides[m, 0], sides[m, 1] = _likely_turn(samples_m, sensor_m, axis_rad[m])
        turned_m = _turned(places_m[:, :count].copy(), sides[m, 0])
        sides[m, 2:] = _edges(turned_m, _turned(sensor_m, sides[m, 0]))
    return sides
