"""Cells around a sensor: which of them hold points, and over which of them beams passed low.

A grid is (x_m, y_m, cell_m): the corner of its first cell from the sensor, and the edge of a cell; it has as many rows
as columns. Sectors begin behind the sensor and are even steps of y / (|x| + |y|), for which no angle has to be computed:
their angles are 0.64 to 1.27 times those of equal ones.
"""

import math

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled
from perception.types import Bool, Float32, Float64, Int

_GRID = (NUMBER, NUMBER, NUMBER)
_NUMBERS, _VALUES = array_of(np.int64), array_of(np.float64)


@compiled((array_of(np.float32, 2), array_of(np.float64, 2), _GRID, WHOLE))
def cells_of_points(
    points: Float32, rotation: Float64, grid: tuple[float, float, float], count: int
) -> tuple[Int, Float64]:
    """Return the (N,) cell of each of (N, 3+) points, count^2 beside all, and their (N, 2) positions from the sensor.

    Args:
        points: Points.
        rotation: (2, 3) rotation from their frame to that of the cells.
        grid: Grid.
        count: Number of rows and columns.
    """
    left_m, low_m, cell_m = grid
    cells, xy_m = np.empty(len(points), np.int64), np.empty((len(points), 2))
    for row in range(len(points)):
        px, py, pz = points[row, 0], points[row, 1], points[row, 2]
        x = rotation[0, 0] * px + rotation[0, 1] * py + rotation[0, 2] * pz
        y = rotation[1, 0] * px + rotation[1, 1] * py + rotation[1, 2] * pz
        i, j = math.floor((x - left_m) / cell_m), math.floor((y - low_m) / cell_m)
        is_inside = i >= 0 and j >= 0 and i < count and j < count
        cells[row] = j * count + i if is_inside else count * count
        xy_m[row, 0], xy_m[row, 1] = x, y
    return cells, xy_m


@compiled((NUMBER, NUMBER, WHOLE))
def sector_of(x: float, y: float, sectors: int) -> int:
    """Return the sector of a position from the sensor."""
    share = y / max(abs(x) + abs(y), 1e-9)
    if x < 0:
        share = 2 - share if y >= 0 else -2 - share
    return min(int((share + 2) * (sectors / 4)), sectors - 1)


@compiled((array_of(np.float64, 2), array_of(np.bool_), array_of(np.bool_), NUMBER, _GRID, WHOLE, WHOLE))  # fmt: skip
def passed_cells(
    xy_m: Float64,
    is_ground: Bool,
    is_obstacle: Bool,
    low_share: float,
    grid: tuple[float, float, float],
    count: int,
    sectors: int,
) -> Bool:
    """Return (count, count) over which cells beams passed low on their way to the ground.

    A beam is low from a share of its range on, as far as no obstacle of its sector is nearer.

    Args:
        xy_m: (N, 2) positions of returns from the sensor.
        is_ground: (N,) which are of the ground.
        is_obstacle: (N,) which are of obstacles.
        low_share: Share of the range.
        grid: Grid.
        count: Number of rows and columns.
        sectors: Number of sectors of a turn.
    """
    left_m, low_m, cell_m = grid
    bins = math.ceil(0.75 * count)
    # What is beyond begins to be low beyond all cells.
    max_range_m = bins * cell_m / max(low_share, 1e-9)
    limits_m = np.full(sectors, np.inf)
    ranges_m, places = np.empty(len(xy_m)), np.empty(len(xy_m), np.int64)
    for row in range(len(xy_m)):
        x, y = xy_m[row, 0], xy_m[row, 1]
        ranges_m[row] = math.sqrt(x * x + y * y)
        if (is_ground[row] or is_obstacle[row]) and ranges_m[row] <= max_range_m:
            places[row] = sector_of(x, y, sectors)
            if is_obstacle[row] and ranges_m[row] < limits_m[places[row]]:
                limits_m[places[row]] = ranges_m[row]
    # Passes begin and end at bins of the range, and are counted from the sensor outwards.
    passes = np.zeros((sectors, bins + 1), np.int32)
    for row in range(len(xy_m)):
        range_m = ranges_m[row]
        if is_ground[row] and range_m <= max_range_m and range_m < limits_m[places[row]]:
            passes[places[row], min(int(range_m * low_share / cell_m), bins)] += 1
            passes[places[row], min(int(range_m / cell_m) + 1, bins)] -= 1
    for place in range(sectors):
        for step in range(1, bins):
            passes[place, step] += passes[place, step - 1]
    is_passed = np.zeros((count, count), np.bool_)
    for j in range(count):
        y = low_m + cell_m * (j + 0.5)
        for i in range(count):
            x = left_m + cell_m * (i + 0.5)
            step = int(math.sqrt(x * x + y * y) / cell_m)
            is_passed[j, i] = step < bins and passes[sector_of(x, y, sectors), step] > 0
    return is_passed
