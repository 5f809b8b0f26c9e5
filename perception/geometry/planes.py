"""Planes through points, and planes z = a x + b y + c that outliers hardly move."""

from collections.abc import Callable

import numpy as np

from perception.types import Float64, Int


def planes_through(triples: Float64) -> Float64:
    """Return (T, 4) planes through (T, 3, 3) point triples, normals up; NaN where they line up."""
    origin = triples[:, 0]
    across = np.cross(triples[:, 1] - origin, triples[:, 2] - origin)
    normals: Float64 = np.asarray(across, np.float64)
    normals = np.where(normals[:, 2:] < 0, -normals, normals)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, lengths, out=np.full_like(normals, np.nan), where=lengths > 1e-9)
    return np.column_stack([normals, -np.sum(normals * origin, axis=1)])


def cauchy_weights(residuals: Float64) -> Float64:
    """Return weights of residuals in units of their scale: outliers count little."""
    return np.asarray(1 / (1 + np.square(residuals)))


def geman_mcclure_weights(residuals: Float64) -> Float64:
    """Return weights of residuals in units of their scale: outliers hardly count, so the start must be near."""
    return np.asarray(1 / np.square(1 + np.square(residuals)))


def fit_height_plane(
    xy: Float64,
    z: Float64,
    start: Float64,
    *,
    scale_m: float,
    rounds: int,
    weights_of: Callable[[Float64], Float64] = cauchy_weights,
) -> Float64:
    """Fit z = a x + b y + c by least squares, reweighted in rounds.

    Args:
        xy: (N, 2) positions in metres.
        z: (N,) heights in metres.
        start: (3,) plane from which the first weights come.
        scale_m: Distance along z at which a point counts clearly less.
        rounds: Number of fits.
        weights_of: Weights of residuals that are divided by the scale.

    Returns:
        (3,) a, b, c.
    """
    design = np.column_stack([xy, np.ones(len(xy))])
    plane = start
    for _ in range(rounds):
        weighted = design * weights_of((z - design @ plane) / scale_m)[:, None]
        plane = np.asarray(
            np.linalg.solve(weighted.T @ design + 1e-9 * np.eye(3), weighted.T @ z), np.float64
        )
    return plane


def lowest_in_cells(xy: Float64, z: Float64, cell_m: float) -> Int:
    """Return the index of the lowest point of every square cell that has any.

    Args:
        xy: (N, 2) positions in metres.
        z: (N,) heights in metres.
        cell_m: Edge of a cell.
    """
    column, row = np.floor(xy / cell_m).astype(np.int64).T
    order = np.lexsort((z, row, column))
    is_new = np.ones(len(order), bool)
    is_new[1:] = (np.diff(column[order]) != 0) | (np.diff(row[order]) != 0)
    return np.asarray(order[is_new])
