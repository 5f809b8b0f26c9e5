"""Reference implementation of the tracking of many objects: one filter per track, in loops.

It gives what the batched tracker must give, line by line as the thesis describes it (5.2.2, Tracking Module).
"""

from dataclasses import dataclass

import numpy as np

from perception.geometry.footprints import Footprints, footprints_of
from perception.geometry.grids import MOVING_OBJECT_AREA
from perception.geometry.se3 import inverse
from perception.tracking.config import PointTrackerConfig, PointTrackerMethod
from perception.tracking.point_tracker import AUTHOR_KEPT_BEYOND_AREA_M
from perception.types import Boxes3D, Float64, Tracks


@dataclass
class ReferenceKalmanFilter:
    """The Kalman filter of one object.

    Attributes:
        mean: (n,) mean of the state.
        covariance: (n, n) covariance of the state.
    """

    mean: Float64
    covariance: Float64

    def predict(self, transition: Float64, process_noise: Float64) -> None:
        """Move the state one step ahead."""
        self.mean = transition @ self.mean
        self.covariance = transition @ self.covariance @ transition.T + process_noise

    def update(self, measured: Float64, observation: Float64, measurement_noise: Float64) -> None:
        """Correct the state by the textbook's form, with an inverse."""
        seen = observation @ self.covariance @ observation.T + measurement_noise
        gain = self.covariance @ observation.T @ np.linalg.inv(seen)
        self.mean = self.mean + gain @ (measured - observation @ self.mean)
        self.covariance = (np.eye(len(self.mean)) - gain @ observation) @ self.covariance

    def mahalanobis_squared(
        self, measured: Float64, observation: Float64, measurement_noise: Float64
    ) -> float:
        """Return how far a measurement is from the expected one."""
        away = measured - observation @ self.mean
        seen = observation @ self.covariance @ observation.T + measurement_noise
        return float(away @ np.linalg.inv(seen) @ away)


def greedy_nearest_by_loop(distances: Float64, gate: float) -> dict[int, int]:
    """Return the detection of each track that has one: gating, then the nearest still free."""
    taken: dict[int, int] = {}
    for track in range(distances.shape[0]):
        best = None
        for detection in range(distances.shape[1]):
            is_free = distances[track, detection] <= gate and detection not in taken.values()
            nearer = best is None or distances[track, detection] < distances[track, best]
            if is_free and nearer:
                best = detection
        if best is not None:
            taken[track] = best
    return taken


@dataclass
class _ReferenceTrack:
    id: int
    filter: ReferenceKalmanFilter
    size_m: Float64
    low_world_m: float
    is_confirmed: bool = False
    is_observed: bool = True

    def bottom_velo_m(self, world_SE3_velo: Float64) -> Float64:
        bottom_world = np.array([*self.filter.mean[:2], self.low_world_m, 1.0])
        return np.asarray((inverse(world_SE3_velo) @ bottom_world)[:3])


class ReferencePointTracker:
    """`PointTracker` with a loop over tracks in every place; implements `MultiObjectTracker`."""

    def __init__(self, method: PointTrackerMethod = "thesis") -> None:
        self.config, self._is_author = PointTrackerConfig(), method == "author"
        self._next_id = 0
        self.clear()

    def clear(self) -> None:
        """End all tracks."""
        self._tracks: list[_ReferenceTrack] = []
        self._stamp_s: float | None = None

    def update(
        self, stamp_s: float, world_SE3_velo: Float64, moving: Footprints, standing: Footprints
    ) -> Tracks:
        """Take in what one scan shows."""
        elapsed_s = 0.1 if self._stamp_s is None else stamp_s - self._stamp_s
        if elapsed_s > 0:
            self._step(0.1 if self._is_author else elapsed_s, world_SE3_velo, moving)
            self._stamp_s = stamp_s
        return self._confirmed_tracks(world_SE3_velo)

    def _step(self, step_s: float, world_SE3_velo: Float64, moving: Footprints) -> None:
        detections = self._detections(world_SE3_velo, moving)
        last_m = [track.filter.mean[:2].copy() for track in self._tracks]
        for track in self._tracks:
            transition = np.eye(4) + step_s * np.eye(4, k=2)
            noise = self.config.process_variance * step_s / 0.1 * np.eye(4)
            track.filter.predict(transition, noise)
        expected_m = (
            last_m if self._is_author else [track.filter.mean[:2] for track in self._tracks]
        )
        distances = np.empty((len(self._tracks), len(detections)))
        for row, place_m in enumerate(expected_m):
            for column, detected in enumerate(detections):
                distances[row, column] = np.linalg.norm(place_m - detected.filter.mean[:2])
        pairs = greedy_nearest_by_loop(distances, self.config.gate_m)
        for row, track in enumerate(self._tracks):
            self._correct(track, last_m[row], detections[pairs[row]] if row in pairs else None)
        self._manage(detections, set(pairs.values()), world_SE3_velo)

    def _detections(self, world_SE3_velo: Float64, moving: Footprints) -> list[_ReferenceTrack]:
        found = []
        for number in range(len(moving)):
            footprint = moving[np.array([number])]
            moved = footprint.moved(world_SE3_velo)
            extent_m = footprint.vertices_m.max(axis=0) - footprint.vertices_m.min(axis=0)
            size_m = np.array([*extent_m, float(footprint.high_m[0] - footprint.low_m[0])])
            mean = np.array([*moved.centroids_m[0], 0.0, 0.0])
            state = ReferenceKalmanFilter(mean, self.config.initial_variance * np.eye(4))
            found.append(_ReferenceTrack(-1, state, size_m, float(moved.low_m[0])))
        return found

    def _correct(
        self, track: _ReferenceTrack, last_m: Float64, seen: _ReferenceTrack | None
    ) -> None:
        noise = self.config.measurement_variance_m2 * np.eye(2)
        track.is_observed = seen is not None
        track.is_confirmed |= track.is_observed or self._is_author
        if seen is not None:
            track.filter.update(seen.filter.mean[:2], np.eye(2, 4), noise)
            track.size_m, track.low_world_m = seen.size_m, seen.low_world_m
        elif self._is_author:
            track.filter.update(last_m, np.eye(2, 4), noise)

    def _manage(
        self, detections: list[_ReferenceTrack], claimed: set[int], world_SE3_velo: Float64
    ) -> None:
        kept = [track for track in self._tracks if track.is_confirmed]
        kept += [track for number, track in enumerate(detections) if number not in claimed]
        margin_m = AUTHOR_KEPT_BEYOND_AREA_M if self._is_author else 0.0
        self._tracks = [t for t in kept if self._is_within(t, world_SE3_velo, margin_m)]
        for track in self._tracks:
            if track.id < 0:
                track.id = self._next_id
                self._next_id += 1

    def _is_within(self, track: _ReferenceTrack, world_SE3_velo: Float64, margin_m: float) -> bool:
        bottom_m = track.bottom_velo_m(world_SE3_velo)
        return bool(MOVING_OBJECT_AREA.contains_xy(bottom_m[None], margin_m)[0])

    def _confirmed_tracks(self, world_SE3_velo: Float64) -> Tracks:
        shown = [
            track
            for track in self._tracks
            if track.is_confirmed and self._is_within(track, world_SE3_velo, 0.0)
        ]
        if not shown:
            return Tracks.empty()
        velocities = [
            world_SE3_velo[:3, :3].T @ np.array([*track.filter.mean[2:], 0.0]) for track in shown
        ]
        return Tracks.unclassified(
            np.array([track.id for track in shown]),
            Boxes3D(
                np.array([track.bottom_velo_m(world_SE3_velo) for track in shown]),
                np.array([track.size_m for track in shown]),
                np.zeros(len(shown)),
            ),
            np.array(velocities)[:, :2],
            np.array([track.is_observed for track in shown]),
        )


def moving_squares(count: int, frames: int, seed: int = 0) -> list[Footprints]:
    """Simulate objects of five points each that drive straight through the local grid, one scan per frame."""
    rng = np.random.default_rng(seed)
    start_m = rng.uniform([-8, -9], [20, 9], (count, 2))
    velocity_m_s = rng.uniform([-2, -1], [4, 1], (count, 2))
    square = np.array([[1, 1, 0.2], [1, -1, 0.2], [-1, -1, 1.5], [-1, 1, 1.5], [0, 0, 1]])
    object_of = np.repeat(np.arange(count), len(square))
    scans = []
    for frame in range(frames):
        center_m = start_m + 0.1 * frame * velocity_m_s + rng.normal(0, 0.1, (count, 2))
        points_m = np.tile(square, (count, 1))
        points_m[:, :2] += np.repeat(center_m, len(square), axis=0)
        scans.append(footprints_of(points_m, object_of, count))
    return scans
