"""Reference of the edges of scans: ranges sorted into a grid of angles, and compared with shifted ones, by NumPy."""

import numpy as np

from perception.types import Bool, Float32, Float64, Int

_FAR_RATIO, _FAR_M, _SAME_RATIO, _SAME_M, _MAX_RANGE_M = 1.1, 0.4, 0.02, 0.25, 60.0


def ranges_by_angle(points: Float32, elevations_rad: Float64, column_rad: float) -> Float32:
    """Return the (L, C) range of the nearest of (N, 4) returns in each direction, infinite without one.

    Args:
        points: (N, 4) returns, ahead of a LiDAR.
        elevations_rad: (L,) elevations of its beams from the top.
        column_rad: Angle between two columns, which count from the left.
    """
    x, y, z = points[:, :3].astype(np.float64).T
    ranges_m = np.sqrt(x * x + y * y + z * z)
    columns = np.floor(np.arctan2(-y, x) / column_rad).astype(np.int64)
    columns -= columns.min()
    between = (elevations_rad[:-1] + elevations_rad[1:]) / 2
    rows = np.searchsorted(-between, -np.arcsin(z / ranges_m))
    grid = np.full((len(elevations_rad), columns.max() + 1), np.inf)
    np.minimum.at(grid, (rows, columns), ranges_m)
    return grid.astype(np.float32)


def edges_by_shifts(ranges_m: Float32) -> tuple[Int, Int, Int]:
    """Return rows, columns and sides (-1 left, 1 right, 0 top) of all edges of an (L, C) grid."""
    found = [_edges_beside(ranges_m, -1), _edges_beside(ranges_m, 1), _edges_above(ranges_m)]
    sides = np.repeat([-1, 1, 0], [len(rows) for rows, _ in found])
    rows, columns = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return rows, columns, sides


def _edges_beside(ranges_m: Float32, side: int) -> tuple[Int, Int]:
    beside_m = np.minimum(_shifted(ranges_m, 0, side), _shifted(ranges_m, 0, 2 * side))
    around_m = np.minimum.reduce(
        [beside_m]
        + [_shifted(ranges_m, row, side * column) for row in (-1, 1) for column in (1, 2)]
    )
    inside = _is_same(ranges_m, 0, -side) | _is_same(ranges_m, 0, -2 * side)
    return _edges(ranges_m, around_m, np.isfinite(beside_m), inside)


def _edges_above(ranges_m: Float32) -> tuple[Int, Int]:
    above_m = _shifted(ranges_m, -1, 0)
    around_m = np.minimum.reduce([above_m, _shifted(ranges_m, -1, -1), _shifted(ranges_m, -1, 1)])
    return _edges(ranges_m, around_m, np.isfinite(above_m), _is_same(ranges_m, 1, 0))


def _edges(
    ranges_m: Float32, around_m: Float32, is_measured: Bool, inside: Bool
) -> tuple[Int, Int]:
    is_edge = (ranges_m < _MAX_RANGE_M) & (around_m > _FAR_RATIO * ranges_m + _FAR_M)
    rows, columns = np.nonzero(is_edge & is_measured & inside)
    return rows, columns


def _is_same(ranges_m: Float32, rows: int, columns: int) -> Bool:
    with np.errstate(invalid="ignore"):  # where both are infinite
        gap_m = np.abs(_shifted(ranges_m, rows, columns) - ranges_m)
    return np.asarray(gap_m < _SAME_M + _SAME_RATIO * ranges_m)


def _shifted(ranges_m: Float32, rows: int, columns: int) -> Float32:
    """Return the range of the pixel so many rows below and columns to the right, infinite beyond the grid."""
    padded = np.pad(ranges_m, 2, constant_values=np.inf)
    height, width = ranges_m.shape
    return padded[2 + rows : 2 + rows + height, 2 + columns : 2 + columns + width]
