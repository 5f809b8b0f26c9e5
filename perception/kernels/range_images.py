"""Range images: where points fall in them, and what the beams around a place tell of it.

A projection is its (2, S) rows of each step of slope, the nearest and the one on the other side of the step, and
(lowest_slope, steps_per_slope, columns_per_rad, columns).
"""

import numpy as np

from perception.kernels.compiled import WHOLE, array_of, compiled, written
from perception.types import Bool, Float32, Int, UInt8

ProjectionNumbers = tuple[float, float, float, int]

_F32 = np.float32
_LINE, _LINE_OUT = array_of(_F32), written(_F32)
_BLOCK = 512
_POINTS, _SLOPES = array_of(_F32, 2), array_of(np.int32, 2)
_IMAGE, _BLOCKS = array_of(_F32, 2), array_of(np.int64, 2)
_PROJECTION = (_F32, _F32, _F32, np.int64)
# Polynomial of the arcus tangent from 0 to 1 in odd powers (Abramowitz and Stegun, 4.4.47): good to 1e-5 rad.
_A1, _A3, _A5, _A7, _A9 = (
    np.float32(value) for value in (0.9998660, -0.3302995, 0.1801410, -0.0851330, 0.0208351)
)
_PI = np.float32(np.pi)


@compiled((_F32, _F32))
def azimuth_rad(x: np.float32, y: np.float32) -> np.float32:
    """Return the direction of (x, y), from 0 to 2 pi."""
    across, along = abs(x), abs(y)
    ratio = min(across, along) / max(across, along, np.float32(1e-30))
    squared = ratio * ratio
    angle = ratio * (_A1 + squared * (_A3 + squared * (_A5 + squared * (_A7 + squared * _A9))))
    angle = _PI / np.float32(2) - angle if along > across else angle
    angle = _PI - angle if x < 0 else angle
    return np.float32(2) * _PI - angle if y < 0 else angle


@compiled((_LINE, _LINE, _LINE, _PROJECTION, _LINE_OUT, written(np.int32), _LINE_OUT))
def _directions(
    x: Float32,
    y: Float32,
    z: Float32,
    projection: ProjectionNumbers,
    steps: Float32,
    columns: Int,
    ranges_m: Float32,
) -> None:
    """Write the step of slope, the column and the range of each point."""
    lowest_slope, steps_per_slope, columns_per_rad, width = projection
    for k in range(len(x)):
        across = np.sqrt(x[k] * x[k] + y[k] * y[k])
        steps[k] = (z[k] / max(across, np.float32(1e-3)) - lowest_slope) * steps_per_slope
        columns[k] = min(int(azimuth_rad(x[k], y[k]) * columns_per_rad), width - 1)
        ranges_m[k] = np.sqrt(across * across + z[k] * z[k])


@compiled((_POINTS, _SLOPES, _PROJECTION))
def pixels_of(
    points: Float32, rows_of_slope: Int, projection: ProjectionNumbers
) -> tuple[Int, Int, Int, Float32, Bool]:
    """Return (P,) nearest and next rows, columns and ranges of (P, 3+) points, and whether a beam points there."""
    count, last = len(points), np.float32(rows_of_slope.shape[1] - 1)
    # Coordinates side by side: the directions take vector instructions.
    x, y, z = np.empty(count, _F32), np.empty(count, _F32), np.empty(count, _F32)
    for k in range(count):
        x[k], y[k], z[k] = points[k, 0], points[k, 1], points[k, 2]
    steps, ranges_m = np.empty(count, _F32), np.empty(count, _F32)
    rows, next_rows = np.empty(count, np.int32), np.empty(count, np.int32)
    columns = np.empty(count, np.int32)
    _directions(x, y, z, projection, steps, columns, ranges_m)
    is_in_view = (steps >= 0) & (steps <= last)
    for k in range(count):
        step = int(min(max(steps[k], np.float32(0)), last))
        rows[k], next_rows[k] = rows_of_slope[0, step], rows_of_slope[1, step]
    return rows, next_rows, columns, ranges_m, is_in_view


@compiled((_POINTS, _SLOPES, _PROJECTION, WHOLE))
def nearest_returns(
    points: Float32, rows_of_slope: Int, projection: ProjectionNumbers, rows: int
) -> Float32:
    """Return the (rows, columns) range of the nearest of (N, 3+) points in each pixel, infinite without one."""
    nearest_m = np.full((rows, projection[3]), np.float32(np.inf))
    last = rows_of_slope.shape[1] - 1
    # Some hundred points at a time, which stay in the cache.
    x, y, z = np.zeros(_BLOCK, _F32), np.zeros(_BLOCK, _F32), np.zeros(_BLOCK, _F32)
    steps, ranges_m = np.empty(_BLOCK, np.float32), np.empty(_BLOCK, np.float32)
    columns = np.empty(_BLOCK, np.int32)
    for start in range(0, len(points), _BLOCK):
        count = min(_BLOCK, len(points) - start)
        for k in range(count):
            x[k], y[k], z[k] = points[start + k, 0], points[start + k, 1], points[start + k, 2]
        _directions(x, y, z, projection, steps, columns, ranges_m)
        for k in range(count):
            if steps[k] >= 0 and steps[k] <= last:
                row, column = rows_of_slope[0, int(steps[k])], columns[k]
                nearest_m[row, column] = min(ranges_m[k], nearest_m[row, column])
    return nearest_m


@compiled((_IMAGE, _LINE, WHOLE, WHOLE, WHOLE, WHOLE, _F32))
def _has_return(
    framed_m: Float32,
    elevations_rad: Float32,
    row: int,
    step: int,
    column: int,
    reach: int,
    reach_rad: float,
) -> bool:
    """Return whether a beam of a row, or of the next ones within reach on that side, has a return within reach."""
    beams, width = framed_m.shape[0] - 2, framed_m.shape[1] - 2
    i = row
    while True:
        for j in range(column - reach, column + reach + 1):
            if framed_m[i + 1, j % width + 1] < np.inf:
                return True
        i += step
        if i < 0 or i >= beams or abs(elevations_rad[i] - elevations_rad[row]) > reach_rad:
            return False


@compiled((_F32, _F32))
def _level(range_m: float, level_0_from_m: float) -> int:
    """Return the level whose blocks span the tolerance at a range."""
    return (
        int(level_0_from_m > range_m)
        + int(level_0_from_m > 2 * range_m)
        + int(level_0_from_m > 4 * range_m)
    )


@compiled((_IMAGE, _LINE, WHOLE, WHOLE, WHOLE, WHOLE))
def _is_bounded(
    framed_m: Float32, elevations_rad: Float32, row: int, next_row: int, column: int, level: int
) -> bool:
    """Return whether a beam above a place and one below it have a return, where the sensor has both.

    Glass and dark paint give none: beams that passed above do not tell that those below did.
    """
    if max(framed_m[row + 1, column + 1], framed_m[next_row + 1, column + 1]) < np.inf:
        return True  # as almost always
    side, reach = next_row - row if next_row != row else 1, 1 << level
    reach_rad = reach * np.float32(2) * _PI / (framed_m.shape[1] - 2)
    return _has_return(
        framed_m, elevations_rad, row, -side, column, reach, reach_rad
    ) and _has_return(framed_m, elevations_rad, next_row, side, column, reach, reach_rad)


@compiled((_IMAGE, WHOLE, WHOLE, WHOLE, WHOLE, _F32))
def _is_passed(
    framed_m: Float32,
    row: int,
    column: int,
    rows_aside: int,
    columns_aside: int,
    passed_from_m: float,
) -> bool:
    """Return whether beams of the block around a pixel have a return, and all their returns are farther than a range."""
    beams, width = framed_m.shape[0] - 2, framed_m.shape[1] - 2
    if framed_m[row + 1, column + 1] <= passed_from_m:
        return False  # as most often
    first, last = column - columns_aside, column + columns_aside
    is_inside, has_return = first >= 0 and last < width, False
    # From below: what is before a place is mostly beside its lower part.
    for i in range(min(row + rows_aside, beams - 1) + 1, max(row - rows_aside, 0), -1):
        is_before = False
        if is_inside:
            # Without a branch, which takes vector instructions.
            for j in range(first + 1, last + 2):
                is_before |= framed_m[i, j] <= passed_from_m
                has_return |= framed_m[i, j] < np.inf
        else:
            for j in range(first, last + 1):
                is_before |= framed_m[i, j % width + 1] <= passed_from_m
                has_return |= framed_m[i, j % width + 1] < np.inf
        if is_before:
            return False
    return has_return


@compiled((_IMAGE, WHOLE, WHOLE, _F32, _F32))
def _is_hit(framed_m: Float32, row: int, column: int, range_m: float, margin_m: float) -> bool:
    """Return whether a return of the 3x3 pixels around one is as far as a place."""
    is_hit = False
    for i in range(row, row + 3):
        for j in range(column, column + 3):
            is_hit |= abs(framed_m[i, j] - range_m) < margin_m
    return is_hit


@compiled((_POINTS, _SLOPES, _PROJECTION, _BLOCKS, _IMAGE, _LINE, _F32, _F32))
def visibility_of(
    points: Float32,
    rows_of_slope: Int,
    projection: ProjectionNumbers,
    blocks: Int,
    framed_m: Float32,
    elevations_rad: Float32,
    level_0_from_m: float,
    margin_m: float,
) -> tuple[UInt8, Float32]:
    """Return whether places are unknown (0), free (1), hit (2) or occluded (3), and the gaps of occluded ones.

    Args:
        points: (P, 3+) places in the frame of the scan.
        rows_of_slope: Rows of the projection.
        projection: Numbers of the projection.
        blocks: (levels, 2) rows and columns to either side of the block around a pixel; level l spans 2^l columns.
        framed_m: (rows + 2, columns + 2) nearest return in each pixel, with a frame of one pixel.
        elevations_rad: (rows,) elevation of each beam, highest first.
        level_0_from_m: Range in metres from which on blocks of level 0 span the tolerance.
        margin_m: Distance in metres of a passing beam beyond, and of an ending one from a place.
    """
    rows, next_rows, columns, ranges_m, is_in_view = pixels_of(points, rows_of_slope, projection)
    states, gaps_m = np.zeros(len(points), np.uint8), np.zeros(len(points), np.float32)
    for k in range(len(points)):
        if not is_in_view[k]:
            continue
        row, column, range_m = rows[k], columns[k], ranges_m[k]
        if abs(framed_m[row + 1, column + 1] - range_m) < margin_m:
            states[k] = 2  # as most often
            continue
        level = _level(range_m, level_0_from_m)
        around, aside = blocks[level, 0], blocks[level, 1]
        if _is_hit(framed_m, row, column, range_m, margin_m):
            states[k] = 2
        elif _is_passed(framed_m, row, column, around, aside, range_m + margin_m):
            states[k] = _is_bounded(framed_m, elevations_rad, row, next_rows[k], column, level)
        elif framed_m[row + 1, column + 1] < range_m - margin_m:
            states[k] = 3
            gaps_m[k] = range_m - framed_m[row + 1, column + 1]
    return states, gaps_m


@compiled((_POINTS, _SLOPES, _PROJECTION, _BLOCKS, _IMAGE, _LINE, _F32, _F32))
def are_free(
    points: Float32,
    rows_of_slope: Int,
    projection: ProjectionNumbers,
    blocks: Int,
    framed_m: Float32,
    elevations_rad: Float32,
    level_0_from_m: float,
    margin_m: float,
) -> Bool:
    """Return which places are free; arguments as of `visibility_of`, which takes twice as long to tell the rest as well."""
    rows, next_rows, columns, ranges_m, is_in_view = pixels_of(points, rows_of_slope, projection)
    free = np.zeros(len(points), np.bool_)
    for k in range(len(points)):
        row, column, range_m = rows[k], columns[k], ranges_m[k]
        if not is_in_view[k] or framed_m[row + 1, column + 1] <= range_m + margin_m:
            continue  # as most often
        level = _level(range_m, level_0_from_m)
        around, aside = blocks[level, 0], blocks[level, 1]
        free[k] = (
            not _is_hit(framed_m, row, column, range_m, margin_m)
            and _is_passed(framed_m, row, column, around, aside, range_m + margin_m)
            and _is_bounded(framed_m, elevations_rad, row, next_rows[k], column, level)
        )
    return free
