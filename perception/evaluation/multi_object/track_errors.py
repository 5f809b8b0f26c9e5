"""Errors of the tracks of moving objects, and false tracks, which match no object in most of their frames."""

from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np

from perception.evaluation.intervals import interval_coverage, squared_mahalanobis
from perception.evaluation.multi_object.track_assignment import FrameAssignment, MovingScene
from perception.evaluation.report import Metric, Metrics
from perception.types import ArrayTable, Bool, Float64, Int, Tracks

NO_TRACK = -1
_HEADING_SPEED_M_S = 1.0  # the heading of a slower track is not defined by its motion


@dataclass(frozen=True)
class TargetErrors(ArrayTable):
    """Errors of K objects that must be tracked, each in one frame; NaN where no track matches.

    Attributes:
        stamps_s: (K,) Time of the frame.
        object_ids: (K,) Track id of the object in the labels.
        track_ids: (K,) Id of the matched track, NO_TRACK without one.
        center_errors_m: (K,) Distance of the centres over the ground.
        velocity_errors_m_s: (K,) Length of the difference of the velocities over the ground.
        heading_errors_rad: (K,) Absolute difference of the headings, 0 to pi.
        length_errors_m: (K,) Length of the track's box less that of the object's.
        width_errors_m: (K,) Width of the track's box less that of the object's.
        center_spread: (K,) Squared Mahalanobis distance of the centres by the track's covariance; NaN without one.
        velocity_spread: (K,) The same of the velocities.
        object_lengths_m: (K,) Length of the object's box.
        object_speeds_m_s: (K,) Speed of the object by the labels.
        track_speeds_m_s: (K,) Speed of the track.
    """

    stamps_s: Float64
    object_ids: Int
    track_ids: Int
    center_errors_m: Float64
    velocity_errors_m_s: Float64
    heading_errors_rad: Float64
    length_errors_m: Float64
    width_errors_m: Float64
    center_spread: Float64
    velocity_spread: Float64
    object_lengths_m: Float64
    object_speeds_m_s: Float64
    track_speeds_m_s: Float64

    @property
    def matched(self) -> Self:
        """Rows with a matched track."""
        return self[self.track_ids != NO_TRACK]

    def by_object(self) -> dict[int, Self]:
        """Return the rows of each object by its id, in ascending order."""
        return {int(n): self[self.object_ids == n] for n in np.unique(self.object_ids)}

    def summary(self) -> "MatchedErrors":
        """Return the errors of all rows with a match."""
        matched = self.matched
        is_fast = matched.track_speeds_m_s > _HEADING_SPEED_M_S
        return MatchedErrors(
            center_m=_median(matched.center_errors_m),
            velocity_m_s=_median(matched.velocity_errors_m_s),
            mean_velocity_m_s=_mean(matched.velocity_errors_m_s),
            heading_rad=_median(matched.heading_errors_rad[is_fast]),
            length_m=_mean(np.abs(matched.length_errors_m)),
            width_m=_mean(np.abs(matched.width_errors_m)),
            center_coverage=interval_coverage(matched.center_spread, 2),
            velocity_coverage=interval_coverage(matched.velocity_spread, 2),
        )

    def of_object(self, kind: str | None) -> "TrackedShare":
        """Return how one object was tracked, of its rows and its class name."""
        matched = self.matched
        return TrackedShare(
            type=kind,
            length_m=_median(self.object_lengths_m),
            speed_m_s=_median(self.object_speeds_m_s),
            frames=len(self),
            frames_tracked=len(matched),
            tracked_percent=100 * len(matched) / len(self),
            tracks=len(np.unique(matched.track_ids)),
            switches=int(np.count_nonzero(np.diff(matched.track_ids))),
            time_to_first_track_s=_median(matched.stamps_s[:1] - self.stamps_s[0]),
            center_m=_median(self.center_errors_m),
            velocity_m_s=_median(self.velocity_errors_m_s),
        )


@dataclass(frozen=True)
class MatchedErrors(Metrics):
    """Errors of matched tracks: medians of position, velocity and heading, means of the rest; NaN without a match.

    Attributes:
        center_m: Distance of the centres over the ground.
        velocity_m_s: Length of the velocity error.
        mean_velocity_m_s: Mean of the same.
        heading_rad: Absolute heading error of tracks faster than 1 m/s.
        length_m: Absolute error of the length.
        width_m: Absolute error of the width.
        center_coverage: Share of the centres within the ellipse that should hold 90 % of them.
        velocity_coverage: The same of the velocities.
    """

    center_m: Annotated[float, Metric("centre [m]", ".3f")]
    velocity_m_s: Annotated[float, Metric("velocity [m/s]", ".3f")]
    mean_velocity_m_s: Annotated[float, Metric("mean [m/s]", ".3f")]
    heading_rad: Annotated[float, Metric("heading [rad]", ".3f")]
    length_m: Annotated[float, Metric("length [m]", ".3f")]
    width_m: Annotated[float, Metric("width [m]", ".3f")]
    center_coverage: Annotated[float, Metric("centres in 90 %", ".3f")]
    velocity_coverage: Annotated[float, Metric("velocities in 90 %", ".3f")]


@dataclass(frozen=True)
class TrackedShare(Metrics):
    """Tracking of one object.

    Attributes:
        type: Class name of the object.
        length_m: Length of its box by the labels.
        speed_m_s: Median speed by the labels.
        frames: Number of frames in which it must be tracked.
        frames_tracked: Number of these frames in which a track matches.
        tracked_percent: Percentage of these frames in which a track matches.
        tracks: Number of different tracks that match.
        switches: Number of times that the matched track changes.
        time_to_first_track_s: Time from the first frame to the first match; NaN without a match.
        center_m: Median distance of the centres over the ground.
        velocity_m_s: Median length of the velocity error.
    """

    type: Annotated[str | None, Metric("type")]
    length_m: Annotated[float, Metric("length [m]", ".1f")]
    speed_m_s: Annotated[float, Metric("[m/s]", ".1f")]
    frames: Annotated[int, Metric("frames")]
    frames_tracked: Annotated[int, Metric("tracked")]
    tracked_percent: Annotated[float, Metric("tracked [%]", ".0f")]
    tracks: Annotated[int, Metric("ids")]
    switches: Annotated[int, Metric("switches")]
    time_to_first_track_s: Annotated[float, Metric("time to first track [s]", ".1f")]
    center_m: Annotated[float, Metric("centre [m]", ".3f")]
    velocity_m_s: Annotated[float, Metric("velocity [m/s]", ".3f")]


def target_errors(
    stamp_s: float, scene: MovingScene, tracks: Tracks, assignment: FrameAssignment
) -> TargetErrors:
    """Return the errors of every object of one frame that must be tracked."""
    targets = assignment.targets
    track_of = np.full(len(scene.objects), NO_TRACK)
    track_of[assignment.matched_objects] = assignment.matched_tracks
    track_of = track_of[targets]
    tracked = track_of != NO_TRACK
    tracks, objects = tracks[track_of[tracked]], scene.objects.boxes_velo[targets]
    true_velocities = scene.velocities_m_s[targets]

    def where_tracked(errors: Float64) -> Float64:
        column = np.full(len(targets), np.nan)
        column[tracked] = errors
        return column

    apart = tracks.boxes.bottom_m - objects.bottom_m[tracked]
    turn_rad = tracks.boxes.yaw_rad - objects.yaw_rad[tracked]
    larger = tracks.boxes.size_m - objects.size_m[tracked]
    faster = tracks.velocities_m_s - true_velocities[tracked]
    centers, velocities = tracks.covariances[:, :2, :2], tracks.covariances[:, 2:, 2:]
    ids = np.full(len(targets), NO_TRACK)
    ids[tracked] = tracks.ids
    return TargetErrors(
        stamps_s=np.full(len(targets), stamp_s),
        object_ids=scene.objects.track_ids[targets],
        track_ids=ids,
        center_errors_m=where_tracked(np.linalg.norm(apart[:, :2], axis=1)),
        velocity_errors_m_s=where_tracked(np.linalg.norm(faster, axis=1)),
        heading_errors_rad=where_tracked(np.abs(np.arctan2(np.sin(turn_rad), np.cos(turn_rad)))),
        length_errors_m=where_tracked(larger[:, 0]),
        width_errors_m=where_tracked(larger[:, 1]),
        center_spread=where_tracked(squared_mahalanobis(apart[:, :2], centers)),
        velocity_spread=where_tracked(squared_mahalanobis(faster, velocities)),
        object_lengths_m=objects.size_m[:, 0],
        object_speeds_m_s=np.linalg.norm(true_velocities, axis=1),
        track_speeds_m_s=where_tracked(np.linalg.norm(tracks.velocities_m_s, axis=1)),
    )


def _median(values: Float64) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")


def _mean(values: Float64) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


@dataclass(frozen=True)
class TrackOutcomes(ArrayTable):
    """Outcomes of K evaluated or ignored tracks, each in one frame.

    Attributes:
        track_ids: (K,) Id of the track.
        is_matched: (K,) Whether it matches an object, also one that need not be tracked.
        is_on_parked: (K,) Whether it matches no object and lies on a parked one.
    """

    track_ids: Int
    is_matched: Bool
    is_on_parked: Bool


def track_outcomes(tracks: Tracks, assignment: FrameAssignment) -> TrackOutcomes:
    """Return for every track of one frame that counts whether it matches an object."""
    rows = np.append(assignment.evaluated, assignment.ignored)
    matched = np.append(assignment.matched_tracks, assignment.ignored)
    return TrackOutcomes(
        tracks.ids[rows], np.isin(rows, matched), np.isin(rows, assignment.on_parked)
    )


@dataclass(frozen=True)
class FalseTracks(Metrics):
    """Tracks that match no object in more than half of the frames in which they count.

    Attributes:
        ids: Ids of the false tracks.
        never_matched: Ids of those that match no object in any frame.
        on_parked: Ids of those that lie on a parked object in some frame.
        per_minute: Number of false tracks per minute of evaluated time; NaN without time.
    """

    ids: Int
    never_matched: Int
    on_parked: Int
    per_minute: Annotated[float, Metric("/min", ".1f")]

    @property
    def count(self) -> Annotated[int, Metric("false tracks")]:
        """Number of false tracks."""
        return len(self.ids)

    @property
    def count_never_matched(self) -> Annotated[int, Metric("never matched")]:
        """Number of tracks that match no object in any frame."""
        return len(self.never_matched)

    @property
    def count_on_parked(self) -> Annotated[int, Metric("of these on parked vehicles")]:
        """Number of false tracks that lie on a parked object in some frame."""
        return len(self.on_parked)


def find_false_tracks(found: TrackOutcomes, duration_s: float) -> FalseTracks:
    """Find the false tracks of any number of frames with a total duration in seconds."""
    ids, row_of = np.unique(found.track_ids.astype(np.int64), return_inverse=True)
    frames = np.bincount(row_of, minlength=len(ids))
    frames_matched = np.bincount(row_of, found.is_matched, minlength=len(ids))
    false = ids[2 * frames_matched < frames]
    return FalseTracks(
        ids=false,
        never_matched=ids[frames_matched == 0],
        on_parked=np.intersect1d(false, found.track_ids[found.is_on_parked.astype(bool)]),
        per_minute=60 * len(false) / duration_s if duration_s else float("nan"),
    )
