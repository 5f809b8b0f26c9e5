"""The nearest return in each direction of a LiDAR, and which of them end before something far."""

import numpy as np

from perception.kernels.compiled import NUMBER, array_of, compiled
from perception.kernels.range_images import azimuth_rad
from perception.types import Float32, Float64, Int, UInt8

_ROWS, _GRID = array_of(np.int64), array_of(np.float32, 2)
MARGIN_ROWS, MARGIN_COLUMNS = 1, 2  # around the grid, of directions without a return
AT_LEFT, AT_RIGHT, AT_TOP = 1, 2, 4


@compiled((array_of(np.float32, 2), _ROWS, NUMBER, NUMBER, NUMBER, array_of(np.float64), NUMBER))
def nearest_by_angle(
    points: Float32,
    rows: Int,
    ahead_x: float,
    ahead_y: float,
    column_rad: float,
    sines: Float64,
    min_range_m: float,
) -> tuple[Float32, Int]:
    """Sort some returns by their directions, and keep the nearest of each.

    Args:
        points: (N, 4) scan.
        rows: (M,) those of its returns that are sorted.
        ahead_x: Direction, seen from above, from which azimuths count to the right: its part along x.
        ahead_y: Its part along y.
        column_rad: Angle between two columns.
        sines: (L - 1,) sines of the elevations between two beams, from the top.
        min_range_m: Range below which returns are left out.

    Returns:
        (L + 2, C + 4) range, infinite without a return, with a margin of one row and two columns.
        (L, C) row of the return in the scan, -1 without one.
    """
    ranges_m, columns = np.empty(len(rows)), np.empty(len(rows), np.int64)
    first, last = 2**62, -(2**62)
    for k in range(len(rows)):
        x, y, z = points[rows[k], 0], points[rows[k], 1], points[rows[k], 2]
        x, y, z = np.float64(x), np.float64(y), np.float64(z)
        ranges_m[k] = np.sqrt(x * x + y * y + z * z)
        if not (ranges_m[k] > min_range_m and ranges_m[k] < np.inf):
            ranges_m[k] = np.inf
            continue
        across, along = x * ahead_y - y * ahead_x, x * ahead_x + y * ahead_y
        turned_rad = azimuth_rad(np.float32(-along), np.float32(-across)) - np.pi
        columns[k] = np.int64(np.floor(turned_rad / column_rad))
        first, last = min(first, int(columns[k])), max(last, int(columns[k]))
    rising, beams, width = -sines, len(sines) + 1, max(last - first + 1, 0)
    grid = np.full((beams + 2 * MARGIN_ROWS, width + 2 * MARGIN_COLUMNS), np.float32(np.inf))
    point_of = np.full((beams, width), -1)
    beam = 0
    for k in range(len(rows)):
        if ranges_m[k] == np.inf:
            continue
        falling = -np.float64(points[rows[k], 2]) / ranges_m[k]
        # Scans are in the order of beams or of firings: the next return is of the same beam or of one beside it.
        while beam < beams - 1 and rising[beam] < falling:
            beam += 1
        while beam > 0 and rising[beam - 1] >= falling:
            beam -= 1
        column = columns[k] - first
        if ranges_m[k] < grid[MARGIN_ROWS + beam, MARGIN_COLUMNS + column]:
            grid[MARGIN_ROWS + beam, MARGIN_COLUMNS + column] = ranges_m[k]
            point_of[beam, column] = rows[k]
    return grid, point_of


@compiled((_GRID, NUMBER, NUMBER, NUMBER, NUMBER, NUMBER))
def edges_of_grid(
    grid: Float32,
    max_range_m: float,
    far_ratio: float,
    far_m: float,
    same_ratio: float,
    same_m: float,
) -> UInt8:
    """Return (L, C) of each return what it ends before something far: the sum of `AT_LEFT`, `AT_RIGHT` and `AT_TOP`.

    Args:
        grid: (L + 2, C + 4) ranges with their margin.
        max_range_m: Range from which on there are no edges.
        far_ratio: Something is far from a return where it is so many times as far, and by a distance more.
        far_m: That distance in metres.
        same_ratio: A neighbour is of the same surface where it is within such a share of the range, and a distance more.
        same_m: That distance in metres.
    """
    beams, width = grid.shape[0] - 2 * MARGIN_ROWS, grid.shape[1] - 2 * MARGIN_COLUMNS
    edges = np.zeros((beams, width), np.uint8)
    for beam in range(beams):
        i = beam + MARGIN_ROWS
        for column in range(width):
            j = column + MARGIN_COLUMNS
            own_m = grid[i, j]
            if not own_m < max_range_m:
                continue
            limit_m, within_m = far_ratio * own_m + far_m, same_m + same_ratio * own_m
            for side, at_side in ((-1, AT_LEFT), (1, AT_RIGHT)):
                # Of neighbours without a return at least one is measured, else it is not known what is there.
                beside_m = min(grid[i, j + side], grid[i, j + 2 * side])
                if not (beside_m > limit_m and beside_m < np.inf):
                    continue
                is_end = True
                for row in (i - 1, i + 1):
                    is_end &= grid[row, j + side] > limit_m
                    is_end &= grid[row, j + 2 * side] > limit_m
                is_surface = abs(grid[i, j - side] - own_m) < within_m
                is_surface |= abs(grid[i, j - 2 * side] - own_m) < within_m
                if is_end and is_surface:
                    edges[beam, column] += at_side
            above_m = grid[i - 1, j]
            if above_m > limit_m and above_m < np.inf:
                is_end = (grid[i - 1, j - 1] > limit_m) & (grid[i - 1, j + 1] > limit_m)
                if is_end and abs(grid[i + 1, j] - own_m) < within_m:
                    edges[beam, column] += AT_TOP
    return edges
