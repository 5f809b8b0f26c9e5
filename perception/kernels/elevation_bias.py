"""By how much the beams of a LiDAR point lower than stated, from one scan and another of the same surfaces.

With points p at elevations that are too low by b, and u the way of a point as its elevation grows, in metres a rad:

    n . (q + b u(q) - T (p + b u(p))) = 0        T, b: the motion between both scans, and the bias

A wrong elevation bends what is flat to a cone around the LiDAR, which comes along with it: no motion explains that.
"""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled, written
from perception.kernels.normal_equations import moved_point, moved_pose, solve
from perception.kernels.scan_matching import match_points
from perception.kernels.surface_normals import SOURCES, SURFACES, NormalSources
from perception.kernels.voxel_table import ROWS, TABLE, VoxelTable
from perception.types import Float64, Int

_ROBUST_M = 0.03  # distance from a surface at which a match weighs a quarter (Geman-McClure)
# Weights by the errors at no bias draw it to 0: they are taken again until it rests.
_ITERATIONS, _STEP_RAD = 10, 2e-5
_SMALL = 3e-3  # rad or m; so small a step changes next to no match


@compiled((ROWS, WHOLE))
def _raising(points: Float64, row: int) -> tuple[float, float, float]:
    """Return the way of a point as its elevation grows, in metres a rad."""
    x, y, z = points[row, 0], points[row, 1], points[row, 2]
    across = max(np.sqrt(x * x + y * y), 1e-6)
    return -z * x / across, -z * y / across, across


@compiled(
    (ROWS, ROWS, ROWS, array_of(np.int64), NUMBER, written(np.float64, 2), written(np.float64))
)
def _add_errors(
    target: Float64,
    source: Float64,
    target_SE3_source: Float64,
    nearest: Int,
    bias_rad: float,
    hessian: Float64,
    gradient: Float64,
) -> tuple[float, float]:
    """Add up the normal equations of the errors: rotation vector, translation, bias.

    Args:
        target: (M, 6) points and normals of the target.
        source: (N, 6) points of the source.
        target_SE3_source: (4, 4) pose of the source.
        nearest: (N,) row of the target that each point matches, -1 for none.
        bias_rad: Bias so far.
        hessian: (7, 7) matrix whose upper triangle is added to.
        gradient: (7,) vector that is added to.

    Returns:
        Sums of the weights and of the weighted squared errors.
    """
    T = target_SE3_source
    weights, squares, slopes = 0.0, 0.0, np.empty(7)
    for row in range(len(source)):
        near = nearest[row]
        if near < 0:
            continue
        nx, ny, nz = target[near, 3], target[near, 4], target[near, 5]
        if nx == 0 and ny == 0 and nz == 0:
            continue
        px, py, pz = moved_point(source, row, T)
        qx, qy, qz = _raising(target, near)
        ux, uy, uz = _raising(source, row)
        qx -= T[0, 0] * ux + T[0, 1] * uy + T[0, 2] * uz
        qy -= T[1, 0] * ux + T[1, 1] * uy + T[1, 2] * uz
        qz -= T[2, 0] * ux + T[2, 1] * uy + T[2, 2] * uz
        growing = nx * qx + ny * qy + nz * qz
        error = nx * (target[near, 0] - px) + ny * (target[near, 1] - py)
        error += nz * (target[near, 2] - pz) + bias_rad * growing
        weight = (_ROBUST_M**2 / (_ROBUST_M**2 + error * error)) ** 2
        slopes[0], slopes[1], slopes[2] = py * nz - pz * ny, pz * nx - px * nz, px * ny - py * nx
        slopes[3], slopes[4], slopes[5], slopes[6] = nx, ny, nz, -growing
        weights, squares = weights + weight, squares + weight * error * error
        for i in range(7):
            gradient[i] += weight * slopes[i] * error
            for j in range(i, 7):
                hessian[i, j] += weight * slopes[i] * slopes[j]
    return weights, squares


@compiled((SURFACES, TABLE, NUMBER, SOURCES, ROWS, ROWS, NUMBER))
def elevation_bias(
    target: Float64,
    table: VoxelTable,
    edge_m: float,
    normals: NormalSources,
    source: Float64,
    target_SE3_source: Float64,
    reach_m: float,
) -> tuple[float, float]:
    """Return the bias in rad and its variance by the errors that are left; the variance is NaN where nothing tells it.

    Args:
        target: (M, 6) points and normals of the target.
        table: Table of its voxels.
        edge_m: Edge of its voxels in metres.
        normals: What normals of the target are found from where they are not known so far.
        source: (N, 6) points and normals of the source.
        target_SE3_source: (4, 4) pose of the source, near the true one.
        reach_m: Largest distance of a match in metres.
    """
    pose, bias_rad, variance = target_SE3_source.copy(), 0.0, np.nan
    nearest = np.empty(len(source), np.int64)
    is_small = False
    for _ in range(_ITERATIONS):
        if not is_small:
            match_points(target, table, edge_m, normals, source, 1, pose, reach_m, nearest)
        hessian, step, last = np.zeros((7, 7)), np.zeros(7), np.zeros(7)
        weights, squares = _add_errors(target, source, pose, nearest, bias_rad, hessian, step)
        last[6] = 1.0
        if not (solve(hessian.copy(), step) and solve(hessian, last)):
            return 0.0, np.nan
        pose, bias_rad = moved_pose(step, pose), bias_rad + step[6]
        variance, is_small = last[6] * squares / weights, np.abs(step[:6]).max() < _SMALL
        if abs(step[6]) < _STEP_RAD:
            break
    return bias_rad, variance
