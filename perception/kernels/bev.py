"""Maps of a scan from above: what the returns fill, what the beams before them passed, and peaks in what a network makes of them.

A map of R x R cells is held by blocks of 4x4, (R / 4, R / 4, 16, C), and a block by blocks of 2x2: cell (i, j) is number
8 a + 4 b + 2 c + d of its block, where a and b are the second last bits of i and j, and c and d the last ones.
"""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled, written
from perception.types import Bool, Float32, Float64, Int, UInt8

_F32, _U8 = np.float32, np.uint8
_TOP, _BOTTOM, _SHARE, _REFLECTANCE, _GROUND = range(5)  # planes after those of the slices
_FREE, _HIDDEN = 1, 2
_STEPS = np.float32(255)
_BIN_M = 2.0  # edge of the cells by which the returns of a box are found
_ABOVE_M = 0.1  # over a box in which returns are its own
_MIN_SINE = 0.15  # of the angle at which a side is seen
_INSIDE = 0.97  # share of the returns within an edge


@compiled((WHOLE, WHOLE))
def _number(i: int, j: int) -> int:
    """Return the number of a cell within its block."""
    return 4 * (i & 2) + 2 * (j & 2) + 2 * (i & 1) + (j & 1)


@compiled(
    (array_of(_F32, 2), array_of(_F32), array_of(_F32), _F32, _F32, array_of(_F32), written(_U8, 4))
)
def fill_cells(
    points: Float32,
    heights_m: Float32,
    edges_m: Float32,
    cell_m: float,
    blind_m: float,
    full_returns: Float32,
    blocks: UInt8,
) -> None:
    """Write the planes of slices, top, bottom, share of returns, reflectance and ground.

    Args:
        points: (N, 4) points in the sensor's frame.
        heights_m: (N,) heights above the ground.
        edges_m: (S + 1,) rising edges of the slices; returns below the first are ground.
        cell_m: Edge of a cell in metres.
        blind_m: Distance from the sensor below which there are no returns but of the vehicle itself.
        full_returns: Number of returns of a full cell by its distance in cells.
        blocks: (R / 4, R / 4, 16, C) map of zeros, of which the first S + 5 planes are written.
    """
    slices, side = len(edges_m) - 1, 4 * blocks.shape[0]
    reach_m, per_m = cell_m * np.float32(side) / np.float32(2), np.float32(1) / cell_m
    low_m, high_m = edges_m[0], edges_m[slices]
    # Rows of the cells with returns, from 1 on.
    row_of_cell, places = np.zeros((side, side), np.int32), np.empty((len(points) + 1, 2), np.int32)
    counts, sums = np.empty(len(places), _F32), np.empty(len(places), _F32)
    rows = 0
    for k in range(len(points)):
        x, y, h = points[k, 0], points[k, 1], heights_m[k]
        u, v = (x + reach_m) * per_m, (y + reach_m) * per_m
        is_inside = u >= 0 and v >= 0 and u < side and v < side
        if not is_inside or h >= high_m or x * x + y * y < blind_m**2:
            continue
        i, j = int(u), int(v)
        a, b, c = i >> 2, j >> 2, _number(i, j)
        if h < low_m:
            blocks[a, b, c, slices + _GROUND] = 255
            continue
        number = 0
        for edge in range(1, slices):  # without a jump that cannot be predicted
            number += h >= edges_m[edge]
        blocks[a, b, c, number] = 255
        level = np.uint8(_STEPS * h / high_m)
        blocks[a, b, c, slices + _TOP] = max(blocks[a, b, c, slices + _TOP], level)
        blocks[a, b, c, slices + _BOTTOM] = max(blocks[a, b, c, slices + _BOTTOM], 255 - level)
        row = row_of_cell[i, j]
        if row == 0:
            rows += 1
            row_of_cell[i, j] = row = rows
            places[row, 0], places[row, 1] = i, j
            counts[row] = sums[row] = 0
        counts[row] += 1
        sums[row] += points[k, 3]
    for row in range(1, rows + 1):
        i, j = places[row, 0], places[row, 1]
        x, y = np.float32(i + 0.5 - side / 2), np.float32(j + 0.5 - side / 2)
        full = full_returns[min(int(np.sqrt(x * x + y * y)), len(full_returns) - 1)]
        a, b, c = i >> 2, j >> 2, _number(i, j)
        share, mean = counts[row] / full, sums[row] / counts[row]
        blocks[a, b, c, slices + _SHARE] = np.uint8(_STEPS * min(share, np.float32(1)))
        blocks[a, b, c, slices + _REFLECTANCE] = np.uint8(_STEPS * min(mean, np.float32(1)))


@compiled((array_of(_F32, 2), array_of(_F32), array_of(np.int32, 2), _F32, WHOLE, array_of(np.int32, 3), written(_U8, 4)))  # fmt: skip
def fill_visibility(
    ranges_m: Float32,
    cosines: Float32,
    spans: Int,
    bin_m: float,
    bins: int,
    bin_of_cell: Int,
    blocks: UInt8,
) -> None:
    """Write the two planes of the cells that beams passed, and of those that beams ended before.

    Args:
        ranges_m: (L, W) nearest return of each beam in each direction, infinite without one.
        cosines: (L,) cosine of the elevation of each beam.
        spans: (L, 2) first and last bin of distance in which a beam is as high as objects are.
        bin_m: Width of a bin of distance in metres.
        bins: Number of bins.
        bin_of_cell: (R / 4, R / 4, 16) place of each cell among the bins and directions, bins first.
        blocks: (R / 4, R / 4, 16, C) map of zeros, of which the last two planes are written.
    """
    beams, columns = ranges_m.shape
    # By how much the numbers of beams that passed, and that ended before, differ from those of the bin before.
    passed, ended = np.zeros((bins + 1, columns), np.int16), np.zeros((bins + 1, columns), np.int16)
    for beam in range(beams):
        first, last = spans[beam, 0], spans[beam, 1]
        for column in range(columns):
            if ranges_m[beam, column] < np.inf:
                end = min(int(ranges_m[beam, column] * cosines[beam] / bin_m), bins)
                if end > first:
                    passed[first, column] += 1
                    passed[min(end, last), column] -= 1
                if end + 1 < last:
                    ended[max(end + 1, first), column] += 1
                    ended[last, column] -= 1
    states = np.empty(bins * columns, _U8)
    free, hidden = np.zeros(columns, np.int16), np.zeros(columns, np.int16)
    for number in range(bins):
        for column in range(columns):
            free[column] += passed[number, column]
            hidden[column] += ended[number, column]
            is_free, is_hidden = free[column] > 0, hidden[column] > 0
            states[number * columns + column] = _FREE * is_free + _HIDDEN * (
                is_hidden & (not is_free)
            )
    cells, bins_of_cells = blocks.reshape(-1, blocks.shape[3]), bin_of_cell.reshape(-1)
    free_plane, hidden_plane = blocks.shape[3] - 2, blocks.shape[3] - 1
    for k in range(len(cells)):
        state = states[bins_of_cells[k]]
        cells[k, free_plane] = 255 * (state == _FREE)
        cells[k, hidden_plane] = 255 * (state == _HIDDEN)


@compiled((array_of(_F32, 3), WHOLE, WHOLE, WHOLE))
def _highest_around(scores: Float32, i: int, j: int, split: int) -> float:
    """Return the highest of 3x3 places about one, of one class."""
    highest = scores[split * (i % split) + j % split, i // split, j // split]
    for u in range(max(i - 1, 0), min(i + 2, split * scores.shape[1])):
        for v in range(max(j - 1, 0), min(j + 2, split * scores.shape[2])):
            score = scores[split * (u % split) + v % split, u // split, v // split]
            highest = max(highest, score)
    return float(highest)


@compiled((array_of(_F32, 4), array_of(_F32, 3), array_of(WHOLE), _F32, _F32))
def peaks_of(
    scores: Float32, stated: Float32, blocks: Int, min_score: float, max_width: float
) -> Int:
    """Return (M, 3) class, part and row of the block of the places of the scores from a minimum on that are peaks.

    A peak is the highest of its 3x3 places, or states that something narrow has its centre in that very place, as each of
    two people side by side has.

    Args:
        scores: (K, S * S, H, W) scores; place (i, j) of a class is part S (i mod S) + j mod S of block (i / S, j / S).
        stated: (16, S * S, P) box at each place of some blocks: row and column in the place first, logarithm of the width fifth.
        blocks: (P,) numbers of these blocks, of the H * W.
        min_score: Lowest score of a peak.
        max_width: Logarithm of the width that something narrow has at most.
    """
    classes, parts, _, columns = scores.shape
    split = int(np.sqrt(parts))
    peaks = np.empty((classes * parts * len(blocks), 3), np.int64)
    found = 0
    for k in range(classes):
        for part in range(parts):
            for block in range(len(blocks)):
                row, column = blocks[block] // columns, blocks[block] % columns
                score = scores[k, part, row, column]
                if score < min_score:
                    continue
                i, j = split * row + part // split, split * column + part % split
                u, v = stated[0, part, block], stated[1, part, block]
                is_narrow = stated[4, part, block] < max_width
                is_center = is_narrow and 0 <= u < 1 and 0 <= v < 1
                if is_center or score >= _highest_around(scores[k], i, j, split):
                    peaks[found, 0], peaks[found, 1], peaks[found, 2] = k, part, block
                    found += 1
    return peaks[:found]


@compiled((array_of(NUMBER, 2), array_of(NUMBER), array_of(WHOLE)))
def unsuppressed(places_m: Float64, radii_m: Float64, groups: Int) -> Bool:
    """Return the (M,) mask of objects, best first, with no better one that stays within the larger radius of the two.

    Args:
        places_m: (M, 2+) centres, best first.
        radii_m: (M,) radii.
        groups: (M,) numbers of groups; objects of two groups do not suppress each other.
    """
    is_kept = np.ones(len(places_m), np.bool_)
    for row in range(len(places_m)):
        for better in range(row):
            if is_kept[better] and groups[better] == groups[row]:
                x_m, y_m = (
                    places_m[row, 0] - places_m[better, 0],
                    places_m[row, 1] - places_m[better, 1],
                )
                if np.sqrt(x_m * x_m + y_m * y_m) < max(radii_m[row], radii_m[better]):
                    is_kept[row] = False
                    break
    return is_kept


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


@compiled((array_of(_F32, 2), array_of(_F32), array_of(np.float64, 2), NUMBER, NUMBER, WHOLE))
def near_edges(
    points: Float32, heights_m: Float32, boxes: Float64, low_m: float, margin_m: float, least: int
) -> Float64:
    """Return (M, 2) how far the returns of each box reach from its middle towards the sensor, along its axis and across.

    NaN where there are few returns, and of a side that is seen at a grazing angle.

    Args:
        points: (N, 4) points in the sensor's frame.
        heights_m: (N,) heights above the ground.
        boxes: (M, 7) x, y and height of the bottom, length, width, height, heading.
        low_m: Height from which a return counts.
        margin_m: Length by which boxes are grown to the sides.
        least: Number of returns from which a box is measured.
    """
    edges_m = np.full((len(boxes), 2), np.nan)
    if len(boxes) == 0:
        return edges_m
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
        back_m = -(cos * x + sin * y), sin * x - cos * y  # from the box to the sensor
        last = int(_INSIDE * (count - 1))
        for axis in range(2):
            if abs(back_m[axis]) >= _MIN_SINE * np.hypot(x, y):
                towards_m = np.sign(back_m[axis]) * places_m[axis, :count]
                edges_m[m, axis] = np.partition(towards_m, last)[last]
    return edges_m
