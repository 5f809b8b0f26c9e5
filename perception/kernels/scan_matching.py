"""Scan matching: GICP between the mean points of the voxels of two scans, and the covariance of the motion found."""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled, written
from perception.kernels.normal_equations import (
    FLATNESS,
    add_matches,
    add_prior,
    moved_point,
    moved_pose,
    solve,
)
from perception.kernels.surface_normals import SOURCES, SURFACES, NormalSources, find_normals
from perception.kernels.voxel_table import ROWS, TABLE, VoxelTable, nearest_mean
from perception.types import Float64, Int

_LOOSER = 3.0  # steps so much larger than the last one still keep their matches, and end the alignment of a quarter
_EIGHTHS = 8
# Share of the inverse of the information matrix in a covariance. By it and the factor of `alignment` 90 % of the errors of
# 720 registrations lie in the 90 % region of all six directions (VLP-16, HDL-32E; steps of 0.1 to 0.5 s); 48 % without it.
_SHRINKAGE = 0.2


@compiled((SURFACES, TABLE, NUMBER, SOURCES, ROWS, WHOLE, ROWS, NUMBER, written(np.int64)))
def match_points(
    target: Float64,
    table: VoxelTable,
    edge_m: float,
    normals: NormalSources,
    source: Float64,
    stride: int,
    target_SE3_source: Float64,
    reach_m: float,
    matches: Int,
) -> None:
    """Find the nearest point of the target for every `stride`-th point of the source, -1 where none is within reach.

    Rows of the target are written to (N,) matches, and their normals to the target where they are not known so far; the
    other arguments are as of `add_matches` and `align_surfaces`.
    """
    unknown, rows = 0, np.empty(len(source), np.int64)
    for row in range(0, len(source), stride):
        x, y, z = moved_point(source, row, target_SE3_source)
        matches[row] = nearest_mean(target, table, edge_m, x, y, z, reach_m)
        if matches[row] >= 0 and np.isnan(target[matches[row], 3]):
            rows[unknown] = matches[row]
            unknown += 1
    if unknown > 0:
        find_normals(normals, table, edge_m, rows[:unknown], target)


@compiled((NUMBER, NUMBER))
def _eighth(x: float, y: float) -> int:
    """Return which of the eighths of a turn a direction is in, 0 to 7."""
    eighth = 0
    if y < 0:
        eighth, x, y = 4, -x, -y
    if x < 0:
        eighth, x, y = eighth + 2, y, -x
    return eighth + 1 if y > x else eighth


@compiled((ROWS, ROWS, ROWS, array_of(np.int64), ROWS, NUMBER, written(np.float64, 2)))
def _leave_out_eighths(
    target: Float64,
    source: Float64,
    target_SE3_source: Float64,
    nearest: Int,
    determined: Float64,
    robust: float,
    covariance: Float64,
) -> bool:
    """Write the covariance of an alignment by how far it moves without the matches of each eighth of the surroundings.

    It is the jackknife over blocks: matches of one wall, one row of trees or one stretch of road err alike, however many
    they are, and what is near to each other is mostly in one eighth.

    Args:
        target: (M, 6) points and normals of the target.
        source: (N, 6) points and normals of the source.
        target_SE3_source: (4, 4) pose of the source.
        nearest: (N,) row of the target that each point matches, -1 for none.
        determined: (6, 6) information matrix of the alignment; its upper triangle is read.
        robust: Squared error at which a match weighs a quarter, 0 for equal weights.
        covariance: (6, 6) matrix that is written.

    Returns:
        Whether the other matches determine the alignment without any eighth.
    """
    eighths, starts = np.empty(len(source), np.int64), np.zeros(_EIGHTHS + 1, np.int64)
    for row in range(len(source)):
        x, y, _ = moved_point(source, row, target_SE3_source)
        eighths[row] = _eighth(x, y)
        starts[eighths[row] + 1] += 1
    starts = np.cumsum(starts)
    ordered, matches = np.empty((len(source), 6)), np.empty(len(source), np.int64)
    ends = starts[:-1].copy()
    for row in range(len(source)):
        place = ends[eighths[row]]
        for column in range(6):
            ordered[place, column] = source[row, column]
        matches[place] = nearest[row]
        ends[eighths[row]] += 1
    covariance[:] = 0
    for eighth in range(_EIGHTHS):
        part = slice(starts[eighth], starts[eighth + 1])
        hessian, motion = np.zeros((6, 6)), np.zeros(6)
        add_matches(
            target, ordered[part], 1, target_SE3_source, matches[part], robust, hessian, motion
        )
        if not solve(determined - hessian, motion):
            return False
        for i in range(6):
            for j in range(6):
                covariance[i, j] += motion[i] * motion[j] * (_EIGHTHS - 1) / _EIGHTHS
    return True


@compiled((ROWS, written(np.float64, 2)))
def _shrink(determined: Float64, covariance: Float64) -> None:
    """Draw a covariance towards the inverse of the information matrix, at the size of both.

    Eight samples leave some of the six directions almost without variance by chance.

    Args:
        determined: (6, 6) information matrix of the alignment; its upper triangle is read.
        covariance: (6, 6) matrix that is drawn.
    """
    size = 0.0
    for i in range(6):
        for j in range(6):
            size += covariance[i, j] * determined[min(i, j), max(i, j)] / 6
    for j in range(6):
        column = np.zeros(6)
        column[j] = size
        if solve(determined.copy(), column):
            for i in range(6):
                covariance[i, j] += _SHRINKAGE * (column[i] - covariance[i, j])


@compiled(
    (
        *(SURFACES, TABLE, NUMBER, SOURCES, ROWS, ROWS),
        *(NUMBER, (NUMBER, NUMBER), WHOLE, NUMBER, NUMBER),
    )
)
def align_surfaces(
    target: Float64,
    table: VoxelTable,
    edge_m: float,
    normals: NormalSources,
    source: Float64,
    initial_guess: Float64,
    reach_m: float,
    steps: tuple[float, float],
    iterations: int,
    prior_share: float,
    robust_m: float,
) -> tuple[Float64, int, float, bool, Float64]:
    """Align the source with the target by Gauss-Newton steps (GICP): with a quarter of its points, then with all.

    Args:
        target: (M, 6) points and normals of the target.
        table: Table of its voxels.
        edge_m: Edge of its voxels in metres.
        normals: What normals of the target are found from where they are not known so far.
        source: (N, 6) points and normals of the source; without normals on either side it is point-to-point ICP.
        initial_guess: (4, 4) first guess of `target_SE3_source`.
        reach_m: Largest distance of a match in metres.
        steps: Rotation in rad and translation in metres of a step that ends the alignment.
        iterations: Largest number of steps with all points, and of those with a quarter.
        prior_share: Share of the matches that, with normals along a direction, tell as much about a motion in it as
            the initial guess does, 0 to 1; 0 for no prior.
        robust_m: Distance from the surfaces on both sides at which a match weighs a quarter, 0 for equal weights.

    Returns:
        (4, 4) `target_SE3_source`, the number of matches, the sum of half their squared errors, whether the last
        step was small enough, and the (6, 6) covariance of a small motion, a rotation vector and a translation in the
        frame of the target, by how well the matches of each eighth of the surroundings agree; NaN where they do not
        determine it.
    """
    pose, matches, error, is_converged = initial_guess.copy(), 0, 0.0, False
    determined, covariance = np.zeros((6, 6)), np.full((6, 6), np.nan)
    nearest, robust = np.empty(len(source), np.int64), robust_m**2 / (2 * FLATNESS)
    for stride in (4, 1):
        is_small = False
        for number in range(iterations + 1):
            # A small step changes next to no match.
            if not is_small:
                match_points(target, table, edge_m, normals, source, stride, pose, reach_m, nearest)
            hessian, motion = np.zeros((6, 6)), np.zeros(6)
            matches, error = add_matches(
                target, source, stride, pose, nearest, robust, hessian, motion
            )
            if number == iterations:
                break
            for axis in range(6):
                hessian[axis, axis] += 1e-6
            if prior_share > 0:
                information = matches * prior_share / (2 * FLATNESS)
                add_prior(pose, initial_guess, information, hessian, motion)
            determined[:] = hessian
            if not solve(hessian, motion):
                return initial_guess.copy(), 0, 0.0, False, covariance
            pose = moved_pose(motion, pose)
            turn = np.sqrt(motion[0] ** 2 + motion[1] ** 2 + motion[2] ** 2)
            way = np.sqrt(motion[3] ** 2 + motion[4] ** 2 + motion[5] ** 2)
            is_small = turn < _LOOSER * steps[0] and way < _LOOSER * steps[1]
            is_converged = is_small and (stride > 1 or (turn < steps[0] and way < steps[1]))
            if is_converged:
                break
    if _leave_out_eighths(target, source, pose, nearest, determined, robust, covariance):
        _shrink(determined, covariance)
    else:
        covariance[:] = np.nan
    return pose, matches, error, is_converged, covariance


@compiled((ROWS, TABLE, NUMBER, ROWS, ROWS, NUMBER))
def distances_to_surfaces(
    target: Float64,
    table: VoxelTable,
    edge_m: float,
    source: Float64,
    target_SE3_source: Float64,
    reach_m: float,
) -> Float64:
    """Return the (N,) distance of each point of the source from the surface at the nearest point of the target.

    It is infinite where none is within reach, and 0 at a point without a surface. All normals of the target are known;
    arguments are as of `align_surfaces`.
    """
    away_m = np.full(len(source), np.inf)
    for row in range(len(source)):
        x, y, z = moved_point(source, row, target_SE3_source)
        near = nearest_mean(target, table, edge_m, x, y, z, reach_m)
        if near >= 0:
            dx, dy, dz = target[near, 0] - x, target[near, 1] - y, target[near, 2] - z
            away_m[row] = abs(dx * target[near, 3] + dy * target[near, 4] + dz * target[near, 5])
    return away_m
