"""The normal equations of a small motion of one scan towards another (GICP), and their solution."""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled, written
from perception.kernels.voxel_table import ROWS
from perception.types import Float64, Int

# Squared noise along the normal of a surface, relative to that along the surface (GICP, Segal et al. 2009).
FLATNESS = 1e-3
_TURN_RADIUS_M = 10.0  # a turn about the LiDAR weighs as the motion of points that far away


@compiled((ROWS, WHOLE, ROWS))
def moved_point(source: Float64, row: int, pose: Float64) -> tuple[float, float, float]:
    """Return the position of a point of the source in the frame of the target."""
    x, y, z = source[row, 0], source[row, 1], source[row, 2]
    return (
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3],
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3],
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3],
    )


@compiled((array_of(np.float64), ROWS))
def moved_pose(motion: Float64, pose: Float64) -> Float64:
    """Return a (4, 4) pose after a motion, a rotation vector and a translation (Rodrigues)."""
    angle = np.sqrt(motion[0] ** 2 + motion[1] ** 2 + motion[2] ** 2)
    x, y, z = motion[0], motion[1], motion[2]
    sine, versine = 1.0, 0.5
    if angle > 1e-9:
        sine, versine = np.sin(angle) / angle, (1 - np.cos(angle)) / (angle * angle)
    rotation = np.empty((3, 3))
    rotation[0, 0], rotation[1, 1] = 1 - versine * (y * y + z * z), 1 - versine * (x * x + z * z)
    rotation[2, 2] = 1 - versine * (x * x + y * y)
    rotation[0, 1], rotation[1, 0] = versine * x * y - sine * z, versine * x * y + sine * z
    rotation[0, 2], rotation[2, 0] = versine * x * z + sine * y, versine * x * z - sine * y
    rotation[1, 2], rotation[2, 1] = versine * y * z - sine * x, versine * y * z + sine * x
    moved = np.zeros((4, 4))
    moved[3, 3] = 1
    for i in range(3):
        moved[i, 3] = motion[3 + i]
        for j in range(4):
            for k in range(3):
                moved[i, j] += rotation[i, k] * pose[k, j]
    return moved


@compiled((written(np.float64, 2), written(np.float64)))
def solve(matrix: Float64, right: Float64) -> bool:
    """Solve a symmetric positive definite system, given by its upper triangle, in place (Cholesky)."""
    size = len(right)
    for i in range(size):
        for j in range(i, size):
            total = matrix[i, j]
            for k in range(i):
                total -= matrix[k, i] * matrix[k, j]
            if i == j:
                if not total > 0:
                    return False
                matrix[i, i] = np.sqrt(total)
            else:
                matrix[i, j] = total / matrix[i, i]
    for i in range(size):
        for k in range(i):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    return True


@compiled(
    (
        ROWS,
        ROWS,
        WHOLE,
        ROWS,
        array_of(np.int64),
        NUMBER,
        written(np.float64, 2),
        written(np.float64),
    )
)
def add_matches(
    target: Float64,
    source: Float64,
    stride: int,
    target_SE3_source: Float64,
    nearest: Int,
    robust: float,
    hessian: Float64,
    gradient: Float64,
) -> tuple[int, float]:
    """Add up the normal equations of a small motion of every `stride`-th point of the source towards its match.

    The motion is a rotation vector and a translation in the frame of the target, applied after `target_SE3_source`.

    Args:
        target: (M, 6) points and normals of the target.
        source: (N, 6) points and normals of the source.
        stride: Step from one point of the source to the next.
        target_SE3_source: (4, 4) pose of the source.
        nearest: (N,) row of the target that each point matches, -1 for none.
        robust: Squared error at which a match weighs a quarter (Geman-McClure), 0 for equal weights.
        hessian: (6, 6) matrix that is added to.
        gradient: (6,) vector that is added to.

    Returns:
        The number of matches and the sum of half their squared errors.
    """
    T = target_SE3_source
    matches, error = 0, 0.0
    jm = np.empty((6, 3))
    for row in range(0, len(source), stride):
        near = nearest[row]
        if near < 0:
            continue
        px, py, pz = moved_point(source, row, T)
        rx, ry, rz = target[near, 0] - px, target[near, 1] - py, target[near, 2] - pz
        tx, ty, tz = target[near, 3], target[near, 4], target[near, 5]
        matches += 1
        nx, ny, nz = source[row, 3], source[row, 4], source[row, 5]
        sx = T[0, 0] * nx + T[0, 1] * ny + T[0, 2] * nz
        sy = T[1, 0] * nx + T[1, 1] * ny + T[1, 2] * nz
        sz = T[2, 0] * nx + T[2, 1] * ny + T[2, 2] * nz
        # Both covariances together: I - (1 - flatness) n n^T each, by the two normals.
        share = 1 - FLATNESS
        a, b = 2 - share * (sx * sx + tx * tx), -share * (sx * sy + tx * ty)
        c, d = -share * (sx * sz + tx * tz), 2 - share * (sy * sy + ty * ty)
        e, f = -share * (sy * sz + ty * tz), 2 - share * (sz * sz + tz * tz)
        # Its inverse by the adjugate.
        A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
        D, E, F = a * f - c * c, b * c - a * e, a * d - b * b
        scale = 1 / (a * A + b * B + c * C)
        A, B, C, D, E, F = A * scale, B * scale, C * scale, D * scale, E * scale, F * scale
        mx, my, mz = A * rx + B * ry + C * rz, B * rx + D * ry + E * rz, C * rx + E * ry + F * rz
        squared = rx * mx + ry * my + rz * mz
        error += squared / 2
        weight = (robust / (robust + squared)) ** 2 if robust > 0 else 1.0
        A, B, C, D, E, F = A * weight, B * weight, C * weight, D * weight, E * weight, F * weight
        mx, my, mz = mx * weight, my * weight, mz * weight
        # J = [-[p]x, I]; rows of J^T M, the upper three are [p]x M.
        jm[0, 0], jm[0, 1], jm[0, 2] = py * C - pz * B, py * E - pz * D, py * F - pz * E
        jm[1, 0], jm[1, 1], jm[1, 2] = pz * A - px * C, pz * B - px * E, pz * C - px * F
        jm[2, 0], jm[2, 1], jm[2, 2] = px * B - py * A, px * D - py * B, px * E - py * C
        hessian[0, 0] += py * jm[0, 2] - pz * jm[0, 1]
        hessian[0, 1] += pz * jm[0, 0] - px * jm[0, 2]
        hessian[0, 2] += px * jm[0, 1] - py * jm[0, 0]
        hessian[1, 1] += pz * jm[1, 0] - px * jm[1, 2]
        hessian[1, 2] += px * jm[1, 1] - py * jm[1, 0]
        hessian[2, 2] += px * jm[2, 1] - py * jm[2, 0]
        for i in range(3):
            for j in range(3):
                hessian[i, 3 + j] += jm[i, j]
        hessian[3, 3] += A
        hessian[3, 4] += B
        hessian[3, 5] += C
        hessian[4, 4] += D
        hessian[4, 5] += E
        hessian[5, 5] += F
        gradient[0] += py * mz - pz * my
        gradient[1] += pz * mx - px * mz
        gradient[2] += px * my - py * mx
        gradient[3], gradient[4], gradient[5] = gradient[3] + mx, gradient[4] + my, gradient[5] + mz
    return matches, error


@compiled((ROWS, ROWS))
def _motion_between(pose: Float64, other: Float64) -> Float64:
    """Return the motion, a rotation vector and a translation, that takes a (4, 4) pose to another at a small angle."""
    motion, turn = other[:3, 3].copy(), np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                turn[i, j] += other[i, k] * pose[j, k]
            motion[i] -= turn[i, j] * pose[j, 3]
    between = np.empty(6)
    between[0], between[1] = (turn[2, 1] - turn[1, 2]) / 2, (turn[0, 2] - turn[2, 0]) / 2
    between[2], between[3:] = (turn[1, 0] - turn[0, 1]) / 2, motion
    return between


@compiled((ROWS, ROWS, NUMBER, written(np.float64, 2), written(np.float64)))
def add_prior(
    pose: Float64, initial_guess: Float64, information: float, hessian: Float64, gradient: Float64
) -> None:
    """Add a prior of the initial guess to the normal equations of the matches.

    Its information matrix is S H^-1 S, with H that of the matches and S the information at which both weigh the same.
    Where the matches tell e times S, the prior tells S / e: the matches have a weight of e^2 to 1. So a well determined
    direction is not pulled, and one that slips along a periodic surface stays.

    Args:
        pose: (4, 4) pose so far.
        initial_guess: (4, 4) pose of the prior.
        information: S for a translation, in the unit of `hessian`.
        hessian: (6, 6) matrix of the matches, that is added to; its upper triangle is read.
        gradient: (6,) vector that is added to.
    """
    even, prior = np.full(6, information), np.empty((6, 6))
    even[:3] *= _TURN_RADIUS_M**2
    for axis in range(6):
        column = np.zeros(6)
        column[axis] = even[axis]
        if not solve(hessian.copy(), column):
            return
        prior[axis] = even * column
    between = _motion_between(pose, initial_guess)
    for i in range(6):
        for j in range(6):
            gradient[i] += prior[i, j] * between[j]
            hessian[i, j] += prior[i, j]
