"""Projection of a scan into an image, and filling of both maps along beams and columns.

`perception.maps.densify` describes the method; here are its loops.
"""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled
from perception.types import Bool, Float32, Float64, Int

_F32, _I32, _I64 = array_of(np.float32), array_of(np.int32), array_of(np.int64)
_CONFIG = (WHOLE, WHOLE, NUMBER, NUMBER, NUMBER)
_DIGIT_BITS = 11

# Column width, largest gap, largest depth ratio, largest slope, extension ratio of `ColumnFillingConfig`.
FillingNumbers = tuple[int, int, float, float, float]


@compiled((_F32,))
def _falling_order(values: Float32) -> Int:
    """Return the order of positive values, the largest first; of equal ones, the first comes last.

    Positive floats and their bits are in the same order, so that three passes over their digits sort them.
    """
    bits = values.view(np.int32)
    order, sorted_order = np.arange(len(values)), np.empty(len(values), np.int64)
    size = 1 << _DIGIT_BITS
    for shift in (0, _DIGIT_BITS, 2 * _DIGIT_BITS):
        starts = np.zeros(size + 1, np.int64)
        for value in bits:
            starts[((value >> shift) & (size - 1)) + 1] += 1
        for digit in range(size):
            starts[digit + 1] += starts[digit]
        for at in range(len(order)):
            digit = (bits[order[at]] >> shift) & (size - 1)
            sorted_order[starts[digit]] = order[at]
            starts[digit] += 1
        order, sorted_order = sorted_order, order
    return order[::-1]


@compiled((array_of(np.float32, 2), array_of(np.float64, 2), WHOLE, WHOLE, NUMBER))
def project_nearest(
    points: Float32, image_P_velo: Float64, width: int, height: int, nearest_m: float
) -> tuple[Int, Float32, Float32]:
    """Project (N, 4) points into an image, and keep the nearest in each pixel.

    Returns:
        (2, K) columns and rows, (K,) depths and (K,) reflectances, the farthest first.
    """
    P = image_P_velo
    owner = np.full(width * height, -1, np.int32)
    rows, depths_m = np.empty(len(points), np.int64), np.empty(len(points), np.float32)
    cells = np.empty(len(points), np.int64)
    found = 0
    for row in range(len(points)):
        x, y, z = points[row, 0], points[row, 1], points[row, 2]
        depth_m = P[2, 0] * x + P[2, 1] * y + P[2, 2] * z + P[2, 3]
        # Points without a return lie at the origin.
        if not depth_m > nearest_m or (x == 0 and y == 0 and z == 0):
            continue
        u = np.rint((P[0, 0] * x + P[0, 1] * y + P[0, 2] * z + P[0, 3]) / depth_m)
        v = np.rint((P[1, 0] * x + P[1, 1] * y + P[1, 2] * z + P[1, 3]) / depth_m)
        if not (u >= 0 and u < width and v >= 0 and v < height):
            continue
        cell = int(v) * width + int(u)
        depth = np.float32(depth_m)
        before = owner[cell]
        if before >= 0:
            if depth < depths_m[before]:
                depths_m[before], rows[before] = depth, row
        else:
            owner[cell], depths_m[found], rows[found], cells[found] = found, depth, row, cell
            found += 1
    order = _falling_order(depths_m[:found])
    pixels = np.empty((2, found), np.int32)
    depth_m, reflectance = np.empty(found, np.float32), np.empty(found, np.float32)
    for at in range(found):
        number = order[at]
        pixels[0, at], pixels[1, at] = cells[number] % width, cells[number] // width
        depth_m[at], reflectance[at] = depths_m[number], points[rows[number], 3]
    return pixels, depth_m, reflectance


@compiled((_I32, _I32, WHOLE, WHOLE))
def highest_rows(columns: Int, rows: Int, width: int, height: int) -> Int:
    """Return the (W,) row of the highest of (N,) pixels in each column, the height of the image without one."""
    highest = np.full(width, height, np.int32)
    for number in range(len(columns)):
        highest[columns[number]] = min(highest[columns[number]], rows[number])
    return highest


@compiled((_I32, WHOLE, WHOLE))
def _median_gap(at: Int, rows: int, margin: int) -> float:
    """Return the median distance of the returns in the columns that are not next to each other, 0 without any."""
    counts = np.zeros(rows + 1, np.int64)
    total = 0
    for first in range(margin * rows, len(at) - margin * rows, rows):
        last = -1
        for row in range(rows):
            if at[first + row] >= 0:
                if last >= 0 and row - last > 1:
                    counts[row - last] += 1
                    total += 1
                last = row
    if total == 0:
        return 0.0
    below, low, high = 0, -1, -1
    for gap in range(rows + 1):
        below += counts[gap]
        if low < 0 and 2 * below >= total:
            low = gap
        if 2 * below > total:
            high = gap
            break
    return (low + high) / 2


@compiled((array_of(np.int32, 2), _F32, _F32, WHOLE, WHOLE, WHOLE, _CONFIG))
def fill_beams(
    pixels: Int,
    depth_m: Float32,
    reflectance: Float32,
    width: int,
    height: int,
    top: int,
    config: FillingNumbers,
) -> Float32:
    """Fill along the beams.

    Args:
        pixels: (2, N) columns and rows of returns, the farthest first.
        depth_m: (N,) their depths.
        reflectance: (N,) their reflectances.
        width: Width of the image.
        height: Height of the image.
        top: Row of the highest return.
        config: Numbers of the configuration.

    Returns:
        (columns, rows, 2) inverse depth and reflectance where a beam passes, below the highest return; 0 elsewhere.
    """
    column_width, max_gap_px, max_depth_ratio, _, extension_ratio = config
    margin = max(1, max_gap_px // column_width)
    columns, rows = (width + column_width - 1) // column_width, height - top + 1
    size = (columns + 2 * margin) * rows
    at = np.full(size, -1, np.int32)
    cells = np.empty(len(depth_m), np.int64)
    for number in range(len(depth_m)):
        cells[number] = (pixels[0, number] // column_width + margin) * rows
        cells[number] += pixels[1, number] - top
        at[cells[number]] = number
    # One return a cell, the nearest; the last row of a column stays blank.
    owns = np.empty(len(depth_m), np.int64)
    count = 0
    for number in range(len(depth_m)):
        if at[cells[number]] == number:
            owns[count] = number
            count += 1
    gap_px = _median_gap(at, rows, margin)
    around = np.full(size, -1, np.int32)
    for step in (-1, 1, 0):
        for k in range(count):
            around[cells[owns[k]] + step] = k
    around[rows - 1 :: rows] = -1
    following, steps = np.full(count, -1, np.int64), np.zeros(count, np.int64)
    is_first = np.ones(count, np.bool_)
    for k in range(count):
        for step in range(1, margin + 1):
            other = around[cells[owns[k]] + step * rows]
            if other >= 0:
                following[k], steps[k], is_first[other] = other, step, False
                break
    filled = np.zeros((size, 2), np.float32)
    # Values of the lowest priority come first and are overwritten; of equal ones, the nearest comes last.
    reach = int(min(max(1, np.rint(extension_ratio * gap_px / column_width)), margin))
    for step in range(reach, 0, -1):
        for k in range(count):
            number = owns[k]
            if steps[k] == 0:
                filled[cells[number] + step * rows, 0] = 1 / depth_m[number]
                filled[cells[number] + step * rows, 1] = reflectance[number]
        for k in range(count):
            number = owns[k]
            if is_first[k]:
                filled[cells[number] - step * rows, 0] = 1 / depth_m[number]
                filled[cells[number] - step * rows, 1] = reflectance[number]
    for k in range(count):
        if steps[k] < 2:
            continue
        begin, end = owns[k], owns[following[k]]
        first, last = 1 / depth_m[begin], 1 / depth_m[end]
        is_surface = max(first, last) <= max_depth_ratio * min(first, last)
        for step in range(1, steps[k]):
            is_behind = 2 * step >= steps[k]
            share = step / steps[k] if is_surface else np.float64(is_behind)
            cell = cells[end] - steps[k] * rows if is_behind else cells[begin]
            cell += step * rows
            filled[cell, 0] = first + share * (last - first)
            filled[cell, 1] = reflectance[begin] + share * (reflectance[end] - reflectance[begin])
    for k in range(count):
        filled[cells[owns[k]], 0] = 1 / depth_m[owns[k]]
        filled[cells[owns[k]], 1] = reflectance[owns[k]]
    inner = filled[margin * rows : (margin + columns) * rows]
    return inner.reshape((columns, rows, 2))


@compiled((array_of(np.bool_), WHOLE))
def _nearest_known(is_known: Bool, column: int) -> int:
    """Return the nearest known column, of two the left one."""
    for away in range(len(is_known)):
        if column - away >= 0 and is_known[column - away]:
            return column - away
        if column + away < len(is_known) and is_known[column + away]:
            return column + away
    return column


@compiled((array_of(np.float32, 3), _I64, WHOLE, WHOLE, WHOLE, _CONFIG))
def fill_between_beams(
    beams: Float32, first_rows: Int, width: int, height: int, top: int, config: FillingNumbers
) -> tuple[Float32, Float32]:
    """Fill along the columns, between the (columns, rows, 2) values of `fill_beams`, whose other arguments these are.

    Each column is filled from its first row in the image on, of (columns,) ones.

    Returns:
        (H, W) depth in metres and (H, W) reflectance, 0 where nothing is filled.
    """
    column_width, max_gap_px, max_depth_ratio, max_slope, _ = config
    columns, rows, _ = beams.shape
    depth_m = np.zeros((height, width), np.float32)
    reflectance = np.zeros((height, width), np.float32)
    is_known = np.zeros(columns, np.bool_)
    for column in range(columns):
        for row in range(rows):
            if beams[column, row, 0] != 0 or beams[column, row, 1] != 0:
                is_known[column] = True
                break
    passed, anchors = np.empty(rows, np.int64), np.empty(rows, np.int64)
    for column in range(columns):
        source = _nearest_known(is_known, column)
        count = 0
        for row in range(rows):
            if beams[source, row, 0] != 0 or beams[source, row, 1] != 0:
                passed[count] = row
                count += 1
        # Without what shows through a hole of a nearer surface.
        seen = 0
        for k in range(count):
            if k > 0 and k < count - 1 and passed[k + 1] - passed[k - 1] <= max_gap_px:
                limit = max_depth_ratio * beams[source, passed[k], 0]
                above, below = beams[source, passed[k - 1], 0], beams[source, passed[k + 1], 0]
                if above > limit and below > limit:
                    continue
            anchors[seen] = passed[k]
            seen += 1
        begins = column * column_width
        ends = min(begins + column_width, width)
        for k in range(-1, seen):
            # From an anchor down to the next, and level from the top of the column to the first.
            upper, lower = anchors[max(k, 0)], anchors[min(k + 1, seen - 1)]
            start = 0 if k < 0 else upper
            stop = rows - 1 if k == seen - 1 else lower
            gap = lower - upper
            inverse, bright = beams[source, upper, 0], beams[source, upper, 1]
            change = beams[source, lower, 0] - inverse
            bright_change = beams[source, lower, 1] - bright
            is_surface = gap > 0 and abs(change) <= max_slope * gap
            for row in range(max(start, first_rows[column] - top), stop):
                share = np.float32(0)
                if is_surface:
                    share = np.float32(row - upper) / np.float32(gap)
                elif gap > 0 and row - upper >= gap - gap // 2:
                    share = np.float32(1)
                depth = 1 / (inverse + share * change)
                value = bright + share * bright_change
                for at in range(begins, ends):
                    depth_m[top + row, at], reflectance[top + row, at] = depth, value
    return depth_m, reflectance
