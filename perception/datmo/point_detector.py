"""Default detector: clusters of the points that the motion stage calls moving."""

import numpy as np

from perception.datmo.clustering import cluster_moving_points
from perception.datmo.config import PointDetectorConfig
from perception.datmo.detector import DetectedObjects, SegmentedScan
from perception.datmo.static_cells import StaticCells
from perception.geometry.footprints import Footprints, footprints_of
from perception.kernels.neighbours import extents_of_clusters
from perception.sensor import LidarModel
from perception.types import Bool, Float32, Float64, GroundModel, Int, PointState


class PointDetector:
    """Clusters the moving points of a scan, and the static points."""

    def __init__(
        self,
        sensor: LidarModel,
        config: PointDetectorConfig | None = None,
    ) -> None:
        """Start without a scan.

        Args:
            sensor: LiDAR model of the scans.
            config: Point detector configuration.
        """
        self._sensor = sensor
        self._config = config or PointDetectorConfig()

    def detect(self, scan: SegmentedScan) -> DetectedObjects:
        """Return the clusters of a scan; each reaches down to the ground."""
        moving = _points_of(scan, PointState.MOVING)
        static = _points_of(scan, PointState.STATIC)
        config = self._config
        cluster_of = cluster_moving_points(
            moving, self._sensor.elevation_step_rad, config.clustering
        )
        static_clusters = Footprints.empty()
        if len(static):
            cells = StaticCells.under(static, config.static_cell_m)
            may_touch = self._beams_across(moving, cluster_of) >= config.min_beams_across
            touches = cells.is_touching(moving) & ~may_touch[cluster_of]
            cluster_of = _without_attached(cluster_of, touches, config.max_attached_ratio)
            static_clusters = cells.clusters(config.static_min_points, config.static_max_length_m)
        return DetectedObjects(
            moving=_on_ground(_outline(moving, cluster_of, config.min_points), scan.ground),
            static=_on_ground(static_clusters, scan.ground),
        )

    def _beams_across(self, moving: Float32, cluster_of: Int) -> Float64:
        """Return the number of beams across each cluster, by its height and its distance."""
        clusters = int(cluster_of.max(initial=-1)) + 1
        low_m, high_m, nearest_m = extents_of_clusters(moving, cluster_of, clusters)
        gap_m = np.maximum(nearest_m, 1.0) * self._sensor.elevation_step_rad
        return np.asarray((high_m - low_m) / gap_m, np.float64)


def _without_attached(cluster_of: Int, touches: Bool, max_share: float) -> Int:
    """Return the (N,) cluster of each point, -1 for clusters of which more than a share touches static points."""
    if len(cluster_of) == 0:
        return cluster_of
    is_attached = np.bincount(cluster_of, touches) > max_share * np.bincount(cluster_of)
    return np.where(is_attached[cluster_of], -1, cluster_of)


def _points_of(scan: SegmentedScan, state: PointState) -> Float32:
    rows = np.flatnonzero(scan.point_states == state)
    return np.asarray(scan.points_velo.take(rows, axis=0), np.float32)


def _outline(points_velo: Float32, cluster_of: Int, min_points: int) -> Footprints:
    """Return the footprints of clusters with enough points; -1 is no cluster."""
    counts = np.bincount(cluster_of + 1)[1:]
    kept = counts >= min_points
    number = np.append(np.where(kept, np.cumsum(kept) - 1, -1), -1)[cluster_of]
    rows = np.flatnonzero(number >= 0)
    return footprints_of(points_velo[rows], number[rows], int(kept.sum()))


def _on_ground(clusters: Footprints, ground: GroundModel) -> Footprints:
    """Extend every cluster down to the ground: its lowest points were classified as ground."""
    low_m = np.minimum(ground.height_m(clusters.centroids_m), clusters.high_m)
    return Footprints(
        clusters.vertices_m,
        clusters.corners,
        clusters.centroids_m,
        low_m,
        clusters.high_m,
        clusters.points,
    )
