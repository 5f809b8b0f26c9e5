"""Heights over the ground plane: points by cell, the normal equations of a smooth surface, distances from it.

A grid is (x0_m, y0_m, cell_m, nodes_x, nodes_y): the position of its first node, the distance between two nodes, and
the number of nodes along x and y. Nodes are numbered along y first.
"""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled, written
from perception.types import Bool, Float, Float32, Float64, Int

GridNumbers = tuple[float, float, float, int, int]

_GRID = (NUMBER, NUMBER, NUMBER, WHOLE, WHOLE)
_POINTS_32, _POINTS_64 = array_of(np.float32, 2), array_of(np.float64, 2)
_CELLS, _VALUES = array_of(np.int64), array_of(np.float64)


@compiled((_POINTS_32, WHOLE, _GRID))
def points_over_cells(points: Float32, stride: int, grid: GridNumbers) -> tuple[Float32, Int]:
    """Return (M, 3) every `stride`-th of (N, 3+) points that lies over a grid, and the (M,) cell of each."""
    x0_m, y0_m, cell_m, nodes_x, nodes_y = grid
    x0, y0, per_m = np.float32(x0_m), np.float32(y0_m), np.float32(1 / cell_m)
    size = (len(points) + stride - 1) // stride
    inside, cells = np.empty((size, 3), np.float32), np.empty(size, np.int64)
    found = 0
    for row in range(0, len(points), stride):
        i, j = (points[row, 0] - x0) * per_m, (points[row, 1] - y0) * per_m
        if i >= 0 and i < nodes_x - 1 and j >= 0 and j < nodes_y - 1:
            for axis in range(3):
                inside[found, axis] = points[row, axis]
            cells[found] = int(i) * nodes_y + int(j)
            found += 1
    return inside[:found], cells[:found]


@compiled((_POINTS_64, _GRID))
def cells_of(points: Float64, grid: GridNumbers) -> Int:
    """Return the (N,) cell of a grid that holds each of (N, 3) points, -1 outside."""
    x0_m, y0_m, cell_m, nodes_x, nodes_y = grid
    cells = np.empty(len(points), np.int64)
    for row in range(len(points)):
        i = int(np.floor((points[row, 0] - x0_m) / cell_m))
        j = int(np.floor((points[row, 1] - y0_m) / cell_m))
        inside = (i >= 0) & (i < nodes_x - 1) & (j >= 0) & (j < nodes_y - 1)
        cells[row] = i * nodes_y + j if inside else -1
    return cells


@compiled((_POINTS_64, _VALUES, _POINTS_64, _POINTS_64, _POINTS_64, NUMBER, _GRID))
def moved_samples(
    points: Float64,
    weights: Float64,
    dst_SE3_src: Float64,
    world_R_dst: Float64,
    covariance: Float64,
    max_deviation_m: float,
    grid: GridNumbers,
) -> tuple[Float64, Float64]:
    """Return those of (N, 3) heights that lie over a grid after a motion of which the poses tell their height.

    Args:
        points: (N, 3) heights.
        weights: (N,) their weights.
        dst_SE3_src: (4, 4) motion.
        world_R_dst: (3, 3) axes of the world, in which the covariance is.
        covariance: (3, 3) covariance of height, roll and pitch.
        max_deviation_m: Largest standard deviation in metres of a height by it.
        grid: Grid.
    """
    x0_m, y0_m, cell_m, nodes_x, nodes_y = grid
    T, R, C = dst_SE3_src, world_R_dst, covariance
    moved, kept = np.empty((len(points), 3)), np.empty(len(points))
    found = 0
    for row in range(len(points)):
        x, y, z = points[row]
        for axis in range(3):
            moved[found, axis] = T[axis, 0] * x + T[axis, 1] * y + T[axis, 2] * z + T[axis, 3]
        x, y, z = moved[found]
        i, j = np.floor((x - x0_m) / cell_m), np.floor((y - y0_m) / cell_m)
        if i < 0 or i >= nodes_x - 1 or j < 0 or j >= nodes_y - 1:
            continue
        roll = R[1, 0] * x + R[1, 1] * y + R[1, 2] * z
        pitch = -(R[0, 0] * x + R[0, 1] * y + R[0, 2] * z)
        variance_m2 = C[0, 0] + roll * (2 * C[0, 1] + roll * C[1, 1])
        variance_m2 += pitch * (2 * C[0, 2] + 2 * roll * C[1, 2] + pitch * C[2, 2])
        if variance_m2 <= max_deviation_m * max_deviation_m:
            kept[found] = weights[row]
            found += 1
    return moved[:found], kept[:found]


@compiled((array_of(np.int64, 2), _POINTS_64, _VALUES))
def interpolated(nodes: Int, weights: Float64, heights_m: Float64) -> Float64:
    """Return (N,) sums of the heights of (4, N) nodes, weighted."""
    sums = np.zeros(nodes.shape[1])
    for k in range(len(sums)):
        for corner in range(4):
            sums[k] += weights[corner, k] * heights_m[nodes[corner, k]]
    return sums


@compiled((_POINTS_32, _CELLS, WHOLE, NUMBER, NUMBER, NUMBER))
def lowest_of_cells(
    points: Float32, cells: Int, size: int, level_m: float, max_step_m: float, max_slope: float
) -> Float64:
    """Return (K, 3) the lowest points of each cell, of equal ones all, among those that can be ground.

    Args:
        points: (M, 3) points.
        cells: (M,) cell of each.
        size: Number of cells.
        level_m: Height of level ground below the origin.
        max_step_m: Largest difference in metres of the ground from level at the origin.
        max_slope: Largest slope by which the ground leaves it with range.
    """
    lowest_m = np.full(size, np.inf, np.float32)
    can_be_ground = np.empty(len(points), np.bool_)
    for row in range(len(points)):
        x, y, z = np.float64(points[row, 0]), np.float64(points[row, 1]), points[row, 2]
        limit_m = max_step_m + max_slope * np.sqrt(x * x + y * y)
        can_be_ground[row] = abs(z - level_m) < limit_m
        if can_be_ground[row] and z < lowest_m[cells[row]]:
            lowest_m[cells[row]] = z
    lowest_points = np.empty((len(points), 3), np.float64)
    found = 0
    for row in range(len(points)):
        if can_be_ground[row] and points[row, 2] == lowest_m[cells[row]]:
            for axis in range(3):
                lowest_points[found, axis] = points[row, axis]
            found += 1
    return lowest_points[:found]


@compiled((_POINTS_32, _CELLS, _VALUES, NUMBER, NUMBER, NUMBER))
def sums_of_cells(
    points: Float32, cells: Int, ground_m: Float64, band_m: float, low_m: float, high_m: float
) -> tuple[Float64, Bool]:
    """Sum the points near the ground by cells.

    Args:
        points: (M, 3) points.
        cells: (M,) cell of each.
        ground_m: (size,) height of the ground in each cell.
        band_m: Largest distance in metres from the ground of a point that is added.
        low_m: Height in metres above the ground from which on a point is one of an obstacle.
        high_m: Height in metres up to which it is.

    Returns:
        (size, 4) sums of x, y, z, and the number of points; (size,) whether the cell has an obstacle.
    """
    sums, has_obstacle = np.zeros((len(ground_m), 4)), np.zeros(len(ground_m), np.bool_)
    for row in range(len(points)):
        cell = cells[row]
        above_m = points[row, 2] - ground_m[cell]
        if abs(above_m) < band_m:
            for axis in range(3):
                sums[cell, axis] += points[row, axis]
            sums[cell, 3] += 1
        if above_m > low_m and above_m < high_m:
            has_obstacle[cell] = True
    return sums, has_obstacle


@compiled((_POINTS_64, _VALUES, _VALUES, (NUMBER, NUMBER), _GRID, written(np.float64, 2)))
def add_normal_equations(
    points: Float64,
    weights: Float64,
    heights_m: Float64,
    scales_m: tuple[float, float],
    grid: GridNumbers,
    banded: Float64,
) -> Float64:
    """Add the matrix of the normal equations of samples to that of a surface, and return their (size,) right side.

    Args:
        points: (N, 3) samples.
        weights: (N,) their weights.
        heights_m: (size,) surface from which residuals are taken: larger ones weigh less (Geman-McClure).
        scales_m: Scale in metres of a residual below and above the surface; infinite for equal weights.
        grid: Grid of the surface.
        banded: (size, bandwidth + 1) matrix, the transpose of LAPACK's upper banded form.
    """
    x0_m, y0_m, cell_m, nodes_x, nodes_y = grid
    right = np.zeros(len(heights_m))
    nodes, shares = np.empty(4, np.int64), np.empty(4)
    for row in range(len(points)):
        u, v = (points[row, 0] - x0_m) / cell_m, (points[row, 1] - y0_m) / cell_m
        i = min(max(int(np.floor(u)), 0), nodes_x - 2)
        j = min(max(int(np.floor(v)), 0), nodes_y - 2)
        u, v = u - i, v - j
        nodes[0], nodes[1] = i * nodes_y + j, i * nodes_y + j + 1
        nodes[2], nodes[3] = nodes[0] + nodes_y, nodes[1] + nodes_y
        shares[0], shares[1] = (1 - u) * (1 - v), (1 - u) * v
        shares[2], shares[3] = u * (1 - v), u * v
        misfit_m = points[row, 2]
        for a in range(4):
            misfit_m -= shares[a] * heights_m[nodes[a]]
        misfit = misfit_m / (scales_m[0] if misfit_m < 0 else scales_m[1])
        weight = weights[row] / (1 + misfit * misfit) ** 2
        for a in range(4):
            right[nodes[a]] += weight * shares[a] * points[row, 2]
            for b in range(a, 4):
                at = banded.shape[1] - 1 - (nodes[b] - nodes[a])
                banded[nodes[b], at] += weight * shares[a] * shares[b]
    return right


@compiled((_POINTS_32, _VALUES, _GRID), (_POINTS_64, _VALUES, _GRID))
def distances_from_surface(points: Float, heights_m: Float64, grid: GridNumbers) -> Float:
    """Return (N,) signed distances of (N, 3+) points from a bilinear surface, along the normal of its cell."""
    x0_m, y0_m, cell_m, nodes_x, nodes_y = grid
    per_m = 1 / cell_m
    normals_z = np.empty(len(heights_m))
    for node in range(len(heights_m) - nodes_y - 1):
        a, b = heights_m[node], heights_m[node + nodes_y]
        c, d = heights_m[node + 1], heights_m[node + nodes_y + 1]
        along_x, along_y = (b + d - a - c) * per_m / 2, (c + d - a - b) * per_m / 2
        normals_z[node] = 1 / np.sqrt(1 + along_x * along_x + along_y * along_y)
    distances_m = np.empty(len(points), points.dtype)
    for row in range(len(points)):
        u, v = (points[row, 0] - x0_m) * per_m, (points[row, 1] - y0_m) * per_m
        # Truncation instead of the floor: positions beyond the lower edge are clipped to cell 0 as well.
        i = min(max(int(u), 0), nodes_x - 2)
        j = min(max(int(v), 0), nodes_y - 2)
        u, v, node = u - i, v - j, i * nodes_y + j
        low_m = heights_m[node] * (1 - v) + heights_m[node + 1] * v
        high_m = heights_m[node + nodes_y] * (1 - v) + heights_m[node + nodes_y + 1] * v
        above_m = points[row, 2] - (low_m * (1 - u) + high_m * u)
        distances_m[row] = above_m * normals_z[node]
    return distances_m
