"""Clustering of moving points over the ground plane, adapted to the pattern of a spinning LiDAR.

A beam's neighbours to the side hit close by; its neighbours above and below hit a slanted surface, a
bonnet or a windscreen, far in front or behind. So gaps within one object lie along the line of sight,
and gaps to its neighbour across it.
"""

import numpy as np

from perception.kernels.neighbours import linked_clusters
from perception.types import Float, Float64, Int

_CELL_M = 0.15  # edge of a cell, whose points are always in one cluster
# Across the line of sight: more than between a pedestrian's legs, less than between two pedestrians side by side.
_LATERAL_GAP_M = 0.4
# Gap along the line of sight that is always bridged, as from a bonnet to a windscreen, and the largest, less than from
# one car to the next; between them, that of two beams on the flattest surface that is bridged.
_MIN_DEPTH_GAP_M, _MAX_DEPTH_GAP_M, _MIN_SURFACE_SLOPE = 0.6, 1.5, 1 / 3


def cluster_moving_points(points_velo: Float, elevation_step_rad: float) -> Int:
    """Return the (N,) cluster of each point, from 0.

    Args:
        points_velo: (N, 2+) points in the LiDAR frame.
        elevation_step_rad: Angle in rad between two beams.
    """
    if len(points_velo) == 0:
        return np.zeros(0, np.int64)
    cell_of, places_m = _cells(points_velo)
    ranges_m = np.hypot(*places_m.T)
    depth_gaps_m = np.clip(
        ranges_m * elevation_step_rad / _MIN_SURFACE_SLOPE, _MIN_DEPTH_GAP_M, _MAX_DEPTH_GAP_M
    )
    order = np.argsort(places_m[:, 0])
    cluster_of_cell = linked_clusters(places_m, depth_gaps_m, _LATERAL_GAP_M, order)
    return np.asarray(cluster_of_cell[cell_of], np.int64)


def _cells(points_velo: Float) -> tuple[Int, Float64]:
    """Return (N,) the cell of each point and (C, 2) the mean place of each cell's points."""
    x_m, y_m = np.ascontiguousarray(points_velo[:, :2].T, np.float64)
    x, y = (np.floor(along_m / _CELL_M).astype(np.int64) for along_m in (x_m, y_m))
    keys = (x - x.min()) * (int(np.ptp(y)) + 1) + (y - y.min())
    _, cell_of, counts = np.unique(keys, return_inverse=True, return_counts=True)
    sums = [np.bincount(cell_of, along_m) for along_m in (x_m, y_m)]
    return np.asarray(cell_of, np.int64), np.column_stack(sums) / counts[:, None]
