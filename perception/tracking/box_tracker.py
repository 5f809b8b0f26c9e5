"""Tracker of moving objects as boxes, the default."""

from dataclasses import replace

import numpy as np

from perception.geometry import se3
from perception.geometry.footprints import Footprints
from perception.geometry.grids import LocalArea
from perception.geometry.se3 import wrap
from perception.kernels.neighbours import are_near
from perception.tracking import motion_model
from perception.tracking.association import assign_hungarian
from perception.tracking.config import BoxTrackerConfig
from perception.tracking.fragments import is_inside_boxes, join_fragments
from perception.tracking.heading import reported_yaws, update_from_course
from perception.tracking.size_estimate import likely_sizes_m, with_sides_swapped
from perception.tracking.track_table import (
    MAX_PAUSE_S,
    TrackTable,
    is_alive,
    is_confirmed,
    is_reported,
    may_be_static,
)
from perception.tracking.track_update import (
    SensorPose,
    init_tracks,
    measure_boxes,
    reported_covariances,
    reported_deviations,
    update_tracks,
)
from perception.tracking.tracker import covariances_velo
from perception.types import Bool, Float64, Int, Tracks

_FRAGMENT_MARGIN_M = 0.3  # around a track's box, within which clusters are fragments of one object
_FRAGMENT_SHARE = 0.5  # maximum number of points of a fragment, in those of the largest one
_STATIC_MARGIN_M = 0.5  # by which a static cluster may be larger than the track that it continues
_STATIC_MIN_SHARE = 0.6  # minimum size of a static cluster, in the track's last observed size
_STATIC_REACH_M = 0.3  # from a static cluster of the last scan, within which one is not new


class BoxTracker:
    """Tracks moving objects as boxes, located by the sides that face the sensor; a `MultiObjectTracker`."""

    def __init__(
        self, area: LocalArea | None = None, config: BoxTrackerConfig | None = None
    ) -> None:
        """Create a tracker without tracks.

        Args:
            area: Local area of the clusters, outside of which unseen tracks are deleted; None for no limit.
            config: Confirmation, reporting and deletion of tracks.
        """
        self._area = area
        self._config = config or BoxTrackerConfig()
        self._next_id = 0
        self.clear()

    def clear(self) -> None:
        """Delete all tracks; their ids are not used again."""
        self._tracks = TrackTable.empty()
        self._static_before_m = np.zeros((0, 2))
        self._stamp_s: float | None = None
        self._elapsed_s = 0.0

    def update(
        self,
        stamp_s: float,
        world_SE3_velo: Float64,
        moving: Footprints,
        static: Footprints,
        covariance: Float64 | None = None,
    ) -> Tracks:
        """Update the tracks by the clusters of one scan, and return the reported ones."""
        if self._stamp_s is None or stamp_s > self._stamp_s:
            self._elapsed_s = 0.0 if self._stamp_s is None else stamp_s - self._stamp_s
            self._stamp_s = stamp_s
            self._predict()
            sensor = SensorPose(world_SE3_velo[:2, 3], covariance)
            new = self._update_with_moving(moving.moved(world_SE3_velo), sensor)
            self._update_with_static(static.moved(world_SE3_velo), sensor)
            self._init_tracks(new, sensor)
            self._join_tracks()
            self._delete_tracks(world_SE3_velo)
        return self._report(self._stamp_s, world_SE3_velo)

    def _predict(self) -> None:
        """Predict the tracks; after a long pause none is left."""
        elapsed_s = self._elapsed_s
        tracks = self._tracks if elapsed_s <= MAX_PAUSE_S else TrackTable.empty()
        predicted = motion_model.predict(update_from_course(tracks, elapsed_s), elapsed_s)
        turn_rad = np.abs(wrap(predicted.yaw_rad - tracks.yaw_rad, np.pi))
        self._tracks = with_sides_swapped(predicted, turn_rad > np.pi / 4)

    def _update_with_moving(self, clusters: Footprints, sensor: SensorPose) -> Footprints:
        """Continue tracks by moving clusters, the confirmed ones first; return the unmatched clusters."""
        confirmed = self._tracks.is_confirmed
        clusters = join_fragments(
            clusters,
            self._is_inside(self._tracks[confirmed], clusters.centroids_m),
            _FRAGMENT_SHARE,
        )
        for rows in (np.flatnonzero(confirmed), np.flatnonzero(~confirmed)):
            if len(clusters) and len(rows):
                tracks = self._tracks[rows]
                measured = measure_boxes(tracks, clusters, sensor)
                costs = motion_model.squared_distances(tracks, measured.centers_m, measured.noise)
                pairs = assign_hungarian(costs, costs <= motion_model.GATE)
                self._update_matched(
                    rows[pairs.tracks], clusters[pairs.detections], sensor, is_moving=True
                )
                clusters = clusters[pairs.unmatched_detections]
        return clusters

    def _is_inside(self, tracks: TrackTable, positions_m: Float64) -> Bool:
        """Return (T, F) whether each position lies within the box of each track, or in its margin."""
        sizes_m = likely_sizes_m(tracks) + 2 * _FRAGMENT_MARGIN_M
        return is_inside_boxes(positions_m, tracks.mean[:, :2], sizes_m, tracks.yaw_rad)

    def _update_with_static(self, clusters: Footprints, sensor: SensorPose) -> None:
        """Continue confirmed tracks by static clusters where no moving cluster has."""
        is_new, before_s = self._is_newly_static(clusters), self._stamp - self._elapsed_s
        rows = np.flatnonzero(may_be_static(self._tracks, self._stamp, before_s))
        if len(clusters) == 0 or len(rows) == 0:
            return
        tracks = self._tracks[rows]
        measured = measure_boxes(tracks, clusters, sensor)
        costs = motion_model.squared_distances(tracks, measured.centers_m, measured.noise)
        room_m = likely_sizes_m(tracks) + _STATIC_MARGIN_M
        min_m = _STATIC_MIN_SHARE * tracks.recent_sizes_m[:, 0]
        fits = (measured.sizes_m <= room_m[:, None]) & (measured.sizes_m >= min_m[:, None])
        was_static = tracks.last_moved_s < tracks.last_seen_s
        may = fits.all(axis=2) & (was_static[:, None] | is_new)
        pairs = assign_hungarian(costs, may & (costs <= motion_model.GATE))
        self._update_matched(
            rows[pairs.tracks], clusters[pairs.detections], sensor, is_moving=False
        )

    def _is_newly_static(self, clusters: Footprints) -> Bool:
        """Return whether each static cluster is new since the last scan, and store them."""
        before, self._static_before_m = self._static_before_m, clusters.centroids_m
        before = before.take(np.argsort(before[:, 0]), axis=0)
        return ~are_near(np.ascontiguousarray(clusters.centroids_m), before, _STATIC_REACH_M)

    def _update_matched(
        self, rows: Int, clusters: Footprints, sensor: SensorPose, *, is_moving: bool
    ) -> None:
        """Correct some tracks by one cluster each."""
        if len(rows) == 0:
            return
        tracks = update_tracks(self._tracks[rows], clusters, sensor)
        stamps_s = np.full(len(rows), self._stamp)
        tracks = replace(
            tracks,
            last_seen_s=stamps_s,
            last_moved_s=stamps_s if is_moving else tracks.last_moved_s,
            hits=tracks.hits + is_moving,
            observed_s=tracks.observed_s + is_moving * self._elapsed_s,
        )
        tracks = replace(tracks, is_confirmed=is_confirmed(tracks, self._config))
        self._tracks = self._tracks.replaced(rows, tracks)

    def _init_tracks(self, clusters: Footprints, sensor: SensorPose) -> None:
        """Begin a track with each unmatched cluster that is not part of a confirmed track's object."""
        sure = self._tracks[self._tracks.is_confirmed]
        is_part = self._is_inside(sure, clusters.centroids_m).any(axis=0)
        clusters = clusters[np.flatnonzero(~is_part)]
        if len(clusters) == 0:
            return
        tracks = init_tracks(clusters, sensor, self._stamp)
        self._tracks = self._tracks.joined(replace(tracks, ids=tracks.ids + self._next_id))
        self._next_id += len(clusters)

    def _join_tracks(self) -> None:
        """Join the tracks of one object: the larger box goes on, by the older id where both moved alike."""
        tracks = self._tracks
        is_within = self._is_inside(tracks, tracks.mean[:, :2]) & tracks.is_confirmed[:, None]
        areas_m2 = likely_sizes_m(tracks).prod(axis=1)
        goes_on = np.ones(len(tracks), bool)
        for older, younger in zip(*np.nonzero(np.triu(is_within | is_within.T, 1)), strict=True):
            is_part = is_within[younger, older] and areas_m2[younger] > areas_m2[older]
            moves_alike = motion_model.moves_alike(tracks, older, younger)
            if not goes_on[older] or not goes_on[younger]:
                continue
            if is_part and moves_alike and tracks.is_confirmed[older]:
                at = np.array([older])
                whole = replace(tracks[np.array([younger])], ids=tracks.ids[at])
                tracks, goes_on[younger] = tracks.replaced(at, whole), False
            elif is_part and is_within[older, younger]:
                goes_on[older] = False
            elif is_within[older, younger]:
                goes_on[younger] = False
        self._tracks = tracks[goes_on]

    def _delete_tracks(self, world_SE3_velo: Float64) -> None:
        """Delete the tracks that are unseen for too long or beyond the area."""
        tracks = self._tracks
        goes_on = is_alive(tracks, self._stamp, self._config)
        if self._area is not None:
            positions_m = np.column_stack([tracks.mean[:, :2], tracks.low_world_m])
            positions_velo = se3.transform_points(se3.inverse(world_SE3_velo), positions_m)
            goes_on &= self._area.contains_xy(positions_velo) | (tracks.last_seen_s == self._stamp)
        self._tracks = self._tracks[goes_on]

    @property
    def _stamp(self) -> float:
        return 0.0 if self._stamp_s is None else self._stamp_s

    def _report(self, stamp_s: float, world_SE3_velo: Float64) -> Tracks:
        """Return the reported tracks in the frame of the scan."""
        tracks = self._tracks[is_reported(self._tracks, stamp_s, self._config)]
        outlines_m = likely_sizes_m(tracks)
        sizes_m = np.column_stack([outlines_m, tracks.heights_m])
        tracks = replace(tracks, yaw_rad=reported_yaws(tracks))
        return Tracks.unclassified(
            tracks.ids,
            tracks.boxes_velo(sizes_m, world_SE3_velo),
            tracks.velocities_velo(world_SE3_velo),
            np.asarray(tracks.last_seen_s == stamp_s),
            covariances_velo(reported_covariances(tracks, sizes_m), world_SE3_velo),
            reported_deviations(tracks, sizes_m),
        )
