"""Default detector: clusters of the points that the motion stage calls moving."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from perception.datmo.detector import DetectedObjects, SegmentedScan
from perception.geometry.footprints import Footprints, footprints_of
from perception.geometry.sorting import sorted_keys
from perception.kernels.ground_cells import are_beside_cells, extents_of_parts, gather_cells
from perception.kernels.neighbours import extents_of_clusters, linked_clusters
from perception.sensor import LidarModel
from perception.types import Bool, Float, Float32, Float64, GroundModel, Int, PointState, UInt8

_CELL_M = 0.15  # edge of a cell, whose points are always in one cluster
# Across the line of sight: more than between a pedestrian's legs, less than between two pedestrians side by side.
_LATERAL_GAP_M = 0.4
# Gap along the line of sight that is always bridged, as from a bonnet to a windscreen, and the largest, less than from
# one car to the next; between them, that of two beams on the flattest surface that is bridged.
_MIN_DEPTH_GAP_M, _MAX_DEPTH_GAP_M, _MIN_SURFACE_SLOPE = 0.6, 1.5, 1 / 3
_MIN_POINTS, _STATIC_MIN_POINTS = 3, 5  # of a moving and of a static cluster
_STATIC_CELL_M = 0.2  # edge of the cells in which static points are joined
_STATIC_MAX_LENGTH_M = 12.0  # of a static cluster; a longer one is a wall or a hedge
# What moves keeps clear of what is static; what comes to light between two beams of a parked car does not. In drives
# with truth one in twenty moving clusters, and three in four false ones, touch with more than a tenth of their points.
_MAX_ATTACHED_RATIO = 0.4
_MIN_BEAMS_ACROSS = 12.0  # between beams that are close together nothing comes to light by chance


@dataclass(frozen=True)
class StaticCells:
    """The C cells with static points.

    Attributes:
        occupancy: (X, Y) 1 where a cell has a static point.
        first: (2,) cell of the corner of `occupancy`, counted from the sensor.
        cell_m: Edge of a cell in metres.
        rows: (C,) indices of the cells in the flattened `occupancy`, rising.
        places_m: (C, 3) mean x and y of a cell's points, and their highest z.
        points: (C,) how many each holds.
    """

    occupancy: UInt8
    first: Int
    cell_m: float
    rows: Int
    places_m: Float64
    points: Int

    @classmethod
    def under(cls, points_velo: Float, cell_m: float) -> "StaticCells":
        """Gather (N, 3+) points, at least one."""
        points = np.ascontiguousarray(points_velo, np.float32)
        occupancy, first, rows, places_m, counts = gather_cells(points, cell_m)
        return cls(occupancy, first, cell_m, rows, places_m, counts)

    def clusters(self, min_points: int, length_m: float) -> Footprints:
        """Return the footprints of clusters up to a length; cells with a common corner are one cluster."""
        _, labels = cv2.connectedComponents(self.occupancy, connectivity=8)
        parts = np.asarray(labels, np.int32)
        cluster_of, sides, points = extents_of_parts(parts, self.rows, self.points)
        kept = (sides * self.cell_m <= length_m) & (points >= min_points)
        kept[0] = False  # the space between
        number = np.cumsum(kept) - 1
        chosen = np.flatnonzero(kept[cluster_of])
        clusters = footprints_of(self.places_m[chosen], number[cluster_of[chosen]], int(kept.sum()))
        return replace(clusters, points=points[kept])

    def is_touching(self, points_velo: Float) -> Bool:
        """Return which of (P, 2+) points lie in a cell with a static point or next to one."""
        points = np.ascontiguousarray(points_velo, np.float32)
        return are_beside_cells(points, self.occupancy, self.first, self.cell_m)


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
    ordered, order = sorted_keys(keys)
    cell_of = np.empty(len(keys), np.int64)
    cell_of[order] = np.cumsum(np.diff(ordered, prepend=ordered[0]) > 0)
    counts, *sums = (np.bincount(cell_of, weights) for weights in (None, x_m, y_m))
    return cell_of, np.column_stack(sums) / counts[:, None]


class PointDetector:
    """Clusters the moving points of a scan, and the static points."""

    def __init__(self, sensor: LidarModel) -> None:
        self._beam_step_rad = sensor.elevation_step_rad

    def detect(self, scan: SegmentedScan) -> DetectedObjects:
        """Return the clusters of a scan; each reaches down to the ground."""
        moving = _points_of(scan, PointState.MOVING)
        static = _points_of(scan, PointState.STATIC)
        cluster_of = cluster_moving_points(moving, self._beam_step_rad)
        static_clusters = Footprints.empty()
        if len(static):
            cells = StaticCells.under(static, _STATIC_CELL_M)
            may_touch = self._beams_across(moving, cluster_of) >= _MIN_BEAMS_ACROSS
            touches = cells.is_touching(moving) & ~may_touch[cluster_of]
            cluster_of = _without_attached(cluster_of, touches)
            static_clusters = cells.clusters(_STATIC_MIN_POINTS, _STATIC_MAX_LENGTH_M)
        return DetectedObjects(
            moving=_on_ground(_outline(moving, cluster_of), scan.ground),
            static=_on_ground(static_clusters, scan.ground),
        )

    def _beams_across(self, moving: Float32, cluster_of: Int) -> Float64:
        """Return the number of beams across each cluster, by its height and its distance."""
        clusters = int(cluster_of.max(initial=-1)) + 1
        low_m, high_m, nearest_m = extents_of_clusters(moving, cluster_of, clusters)
        gap_m = np.maximum(nearest_m, 1.0) * self._beam_step_rad
        return np.asarray((high_m - low_m) / gap_m, np.float64)


def _without_attached(cluster_of: Int, touches: Bool) -> Int:
    """Return the (N,) cluster of each point, -1 for clusters of which too much touches static points."""
    if len(cluster_of) == 0:
        return cluster_of
    is_attached = np.bincount(cluster_of, touches) > _MAX_ATTACHED_RATIO * np.bincount(cluster_of)
    return np.where(is_attached[cluster_of], -1, cluster_of)


def _points_of(scan: SegmentedScan, state: PointState) -> Float32:
    rows = np.flatnonzero(scan.point_states == state)
    return np.asarray(scan.points_velo.take(rows, axis=0), np.float32)


def _outline(points_velo: Float32, cluster_of: Int) -> Footprints:
    """Return the footprints of clusters with enough points; -1 is no cluster."""
    counts = np.bincount(cluster_of + 1)[1:]
    kept = counts >= _MIN_POINTS
    number = np.append(np.where(kept, np.cumsum(kept) - 1, -1), -1)[cluster_of]
    rows = np.flatnonzero(number >= 0)
    return footprints_of(points_velo[rows], number[rows], int(kept.sum()))


def _on_ground(clusters: Footprints, ground: GroundModel) -> Footprints:
    """Extend every cluster down to the ground: its lowest points were classified as ground."""
    low_m = np.minimum(ground.height_m(clusters.centroids_m), clusters.high_m)
    return replace(clusters, low_m=low_m)
