"""The thesis' tracker (5.2.2, Tracking Module): each object is a point with a Kalman filter of its own.

An unmatched detection begins a track; the next frame confirms or deletes it. A track without a detection is predicted.
A confirmed track is deleted only when it leaves the local grid.

The author's released program differs. It takes every step as 0.1 s and gates around the last estimate. A miss corrects a
track by its last position, which brakes it to a halt. Every track is shown from its second frame on and none deleted.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from perception.geometry.footprints import Footprints
from perception.geometry.grids import MOVING_OBJECT_AREA, LocalArea
from perception.geometry.se3 import inverse
from perception.tracking.association import Association, assign_greedily
from perception.tracking.config import PointTrackerConfig, PointTrackerMethod
from perception.tracking.kalman import Gaussians, predict, update
from perception.tracking.tracker import covariances_velo
from perception.types import ArrayTable, Bool, Boxes3D, Float64, Int, Tracks

# State of an object in the world: [x_m, y_m, velocity_x_m_s, velocity_y_m_s].
_OBSERVATION = np.eye(2, 4)
_NOMINAL_STEP_S = 0.1  # of a LiDAR at 10 Hz, to which the released noise belongs
# With every track of the released program, the cost would grow with the drive. A detection lies in the area, and nothing
# beyond the gate around it can matter unless the vehicle comes back; 40 m, the length of the area, lets it turn round and
# still find its tracks.
AUTHOR_KEPT_BEYOND_AREA_M = 40.0
_CONFIG = PointTrackerConfig()


@dataclass(frozen=True)
class _PointTracks(ArrayTable):
    """T objects between two frames.

    Attributes:
        ids: (T,) ids, rising.
        states: (T) states in the world.
        low_world_m: (T,) z of the lowest point of the last observation.
        size_m: (T, 3) size along x, y and z of the LiDAR frame in the last observation.
        is_confirmed: (T,) whether the track is confirmed.
        is_observed: (T,) whether the last frame observed the object.
    """

    ids: Int
    states: Gaussians
    low_world_m: Float64
    size_m: Annotated[Float64, 3]
    is_confirmed: Bool
    is_observed: Bool


class PointTracker:
    """Tracks moving objects as points, all filters of a frame in one computation; a `MultiObjectTracker`."""

    def __init__(
        self,
        method: PointTrackerMethod = "thesis",
        config: PointTrackerConfig = _CONFIG,
        area: LocalArea = MOVING_OBJECT_AREA,
    ) -> None:
        """Start without a track.

        Args:
            method: Whether the tracker is that of the thesis or of the author's released program.
            config: Noise and gate.
            area: Local grid in the LiDAR frame, outside of which no track is reported (5.2.2).
        """
        self._is_author, self._config, self._area = method == "author", config, area
        self._next_id = 0
        self.clear()

    def __len__(self) -> int:
        """Return the number of tracks, reported or not."""
        return len(self._tracks)

    def clear(self) -> None:
        """Delete all tracks; their ids are not used again."""
        self._tracks = self._init_tracks(Footprints.empty(), np.eye(4))
        self._stamp_s: float | None = None

    def update(
        self,
        stamp_s: float,
        world_SE3_velo: Float64,
        moving: Footprints,
        static: Footprints,
        covariance: Float64 | None = None,
    ) -> Tracks:
        """Update the tracks by the moving clusters of one scan, and return the reported ones.

        Args:
            stamp_s: Time of the scan; a scan that is not later than the last one changes nothing.
            world_SE3_velo: (4, 4) pose of the scan.
            moving: Moving clusters in the LiDAR frame of the scan.
            static: Static clusters; they are not used.
            covariance: Covariance of the pose; it is not used.
        """
        elapsed_s = _NOMINAL_STEP_S if self._stamp_s is None else stamp_s - self._stamp_s
        if elapsed_s > 0:
            self._step(elapsed_s, world_SE3_velo, moving)
            self._stamp_s = stamp_s
        return self._report(world_SE3_velo)

    def _step(self, step_s: float, world_SE3_velo: Float64, moving: Footprints) -> None:
        """Predict, associate, correct, and manage all tracks."""
        before, new_tracks = self._tracks, self._init_tracks(moving, world_SE3_velo)
        measured_m = new_tracks.states.mean[:, :2]

        # Prediction, then gating and nearest neighbour.
        step_s = _NOMINAL_STEP_S if self._is_author else step_s
        predicted = self._predict(before.states, step_s)
        expected = before.states if self._is_author else predicted
        pairs = self._associate(expected.mean[:, :2], measured_m)

        # Correction, and the shape of what was seen.
        states = self._correct(before.states, predicted, measured_m, pairs)
        after = self._update_matched(replace(before, states=states), new_tracks, pairs)

        # Track management: initialisation, confirmation, removal.
        after = after[after.is_confirmed]
        born = new_tracks[pairs.unmatched_detections]
        after, born = (f[self._is_near(f, world_SE3_velo)] for f in (after, born))
        self._tracks = after.joined(replace(born, ids=self._next_id + np.arange(len(born))))
        self._next_id += len(born)

    def _init_tracks(self, moving: Footprints, world_SE3_velo: Float64) -> _PointTracks:
        """Return each detection as a new track, without an id."""
        count, moved = len(moving), moving.moved(world_SE3_velo)
        min_m, greatest_m = moving.extents_m(np.zeros(count))
        covariance = self._config.initial_variance * np.eye(4)
        return _PointTracks(
            ids=np.full(count, -1),
            states=Gaussians(
                np.column_stack([moved.centroids_m, np.zeros((count, 2))]),
                np.tile(covariance, (count, 1, 1)),
            ),
            low_world_m=moved.low_m,
            size_m=np.column_stack([greatest_m - min_m, moving.high_m - moving.low_m]),
            is_confirmed=np.zeros(count, bool),
            is_observed=np.ones(count, bool),
        )

    def _predict(self, states: Gaussians, step_s: float) -> Gaussians:
        transition = np.eye(4) + step_s * np.eye(4, k=2)
        grown = self._config.process_variance * step_s / _NOMINAL_STEP_S
        return predict(states, transition, grown * np.eye(4))

    def _associate(self, expected_m: Float64, measured_m: Float64) -> Association:
        distances_m = np.linalg.norm(expected_m[:, None] - measured_m[None], axis=2)
        return assign_greedily(distances_m, distances_m <= self._config.gate_m)

    def _correct(
        self, before: Gaussians, predicted: Gaussians, measured_m: Float64, pairs: Association
    ) -> Gaussians:
        """Correct the observed tracks and, as the author does, the others by their last position."""
        noise = self._config.measurement_variance_m2 * np.eye(2)
        if self._is_author:
            every_m = before.mean[:, :2].copy()
            every_m[pairs.tracks] = measured_m[pairs.detections]
            return update(predicted, every_m, _OBSERVATION, noise)
        seen = update(predicted[pairs.tracks], measured_m[pairs.detections], _OBSERVATION, noise)
        return predicted.replaced(pairs.tracks, seen)

    def _update_matched(
        self, tracks: _PointTracks, new_tracks: _PointTracks, pairs: Association
    ) -> _PointTracks:
        """Update which tracks are observed, and their size and height."""
        low_world_m, size_m = tracks.low_world_m.copy(), tracks.size_m.copy()
        low_world_m[pairs.tracks] = new_tracks.low_world_m[pairs.detections]
        size_m[pairs.tracks] = new_tracks.size_m[pairs.detections]
        is_observed = np.zeros(len(tracks), bool)
        is_observed[pairs.tracks] = True
        is_confirmed = tracks.is_confirmed | is_observed | self._is_author
        return replace(
            tracks,
            low_world_m=low_world_m,
            size_m=size_m,
            is_observed=is_observed,
            is_confirmed=is_confirmed,
        )

    def _is_near(self, tracks: _PointTracks, world_SE3_velo: Float64) -> Bool:
        """Return whether each object is within the area or the distance at which its track is kept."""
        bottom_m = _bottoms_in_velo(tracks, world_SE3_velo)
        margin_m = AUTHOR_KEPT_BEYOND_AREA_M if self._is_author else 0.0
        return self._area.contains_xy(bottom_m, margin_m)

    def _report(self, world_SE3_velo: Float64) -> Tracks:
        """Return the confirmed tracks inside the area, in the LiDAR frame of a pose."""
        bottom_m = _bottoms_in_velo(self._tracks, world_SE3_velo)
        shown = self._tracks.is_confirmed & self._area.contains_xy(bottom_m)
        tracks = self._tracks[shown]
        velocity_world_m_s = tracks.states.mean[:, 2:]
        return Tracks.unclassified(
            tracks.ids,
            # The thesis' boxes ignore the orientation: they lie along the vehicle's axes.
            Boxes3D(bottom_m[shown], tracks.size_m, np.zeros(len(tracks))),
            velocity_world_m_s @ world_SE3_velo[:2, :2],
            tracks.is_observed,
            covariances_velo(tracks.states.covariance, world_SE3_velo),
        )


def _bottoms_in_velo(tracks: _PointTracks, world_SE3_velo: Float64) -> Float64:
    """Return (T, 3) the bottom centres in the LiDAR frame of a pose."""
    bottom_world_m = np.column_stack([tracks.states.mean[:, :2], tracks.low_world_m])
    velo_SE3_world = inverse(world_SE3_velo)
    return np.asarray(bottom_world_m @ velo_SE3_world[:3, :3].T + velo_SE3_world[:3, 3])
