"""Errors of the tracks of objects that must be tracked: position, velocity, heading and extent."""

from dataclasses import dataclass

import numpy as np

from perception.evaluation.multi_object.moving_scene import MovingScene
from perception.evaluation.multi_object.track_assignment import FrameAssignment
from perception.types import ArrayTable, Bool, Float64, Int, Tracks

NO_TRACK = -1


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
    object_speeds_m_s: Float64
    track_speeds_m_s: Float64

    @property
    def is_tracked(self) -> Bool:
        """(K,) Whether a track matches the object."""
        return np.asarray(self.track_ids != NO_TRACK)


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
        object_speeds_m_s=np.linalg.norm(true_velocities, axis=1),
        track_speeds_m_s=where_tracked(np.linalg.norm(tracks.velocities_m_s, axis=1)),
    )


@dataclass(frozen=True)
class TrackErrors:
    """Summary of the errors of matched tracks; NaN without a match.

    Attributes:
        pairs: Number of pairs of an object and its track.
        center_m: Median distance of the centres.
        velocity_m_s: Median difference of the velocities.
        mean_velocity_m_s: Mean difference of the velocities.
        heading_rad: Median heading error of tracks faster than 1 m/s.
        length_m: Mean absolute error of the length.
        width_m: Mean absolute error of the width.
    """

    pairs: int
    center_m: float
    velocity_m_s: float
    mean_velocity_m_s: float
    heading_rad: float
    length_m: float
    width_m: float


_HEADING_SPEED_M_S = 1.0  # the heading of a slower track is not defined by its motion


def track_errors(tracked: TargetErrors) -> TrackErrors:
    """Summarise the errors of any number of frames."""
    pairs = tracked[tracked.is_tracked]
    fast = pairs.track_speeds_m_s > _HEADING_SPEED_M_S
    return TrackErrors(
        pairs=len(pairs),
        center_m=_median(pairs.center_errors_m),
        velocity_m_s=_median(pairs.velocity_errors_m_s),
        mean_velocity_m_s=_mean(pairs.velocity_errors_m_s),
        heading_rad=_median(pairs.heading_errors_rad[fast]),
        length_m=_mean(np.abs(pairs.length_errors_m)),
        width_m=_mean(np.abs(pairs.width_errors_m)),
    )


@dataclass(frozen=True)
class ObjectSummary:
    """Tracking of one object over the drive.

    Attributes:
        object_id: Track id of the object in the labels.
        frames: Number of frames in which it must be tracked.
        frames_tracked: Number of these frames in which a track matches it.
        tracks: Number of different tracks that match it.
        switches: Number of times that the matched track changes.
        time_to_first_track_s: Time from its first frame to the first match; NaN without a match.
        center_m: Median distance of the centres.
        velocity_m_s: Median difference of the velocities.
        speed_m_s: Median speed by the labels.
    """

    object_id: int
    frames: int
    frames_tracked: int
    tracks: int
    switches: int
    time_to_first_track_s: float
    center_m: float
    velocity_m_s: float
    speed_m_s: float

    @property
    def share(self) -> float:
        """Share of its frames in which a track matches it."""
        return self.frames_tracked / self.frames

    @property
    def is_never_tracked(self) -> bool:
        """Whether no track ever matches it."""
        return self.frames_tracked == 0


def summarise_objects(tracked: TargetErrors) -> list[ObjectSummary]:
    """Return a summary of every object in ascending order of their ids."""
    numbers = np.unique(tracked.object_ids)
    return [_summarise(int(n), tracked[tracked.object_ids == n]) for n in numbers]


def _summarise(object_id: int, rows: TargetErrors) -> ObjectSummary:
    pairs = rows[rows.is_tracked]
    waited_s = pairs.stamps_s[:1] - rows.stamps_s[0]
    return ObjectSummary(
        object_id=object_id,
        frames=len(rows),
        frames_tracked=len(pairs),
        tracks=len(np.unique(pairs.track_ids)),
        switches=int(np.count_nonzero(np.diff(pairs.track_ids))),
        time_to_first_track_s=_median(waited_s),
        center_m=_median(pairs.center_errors_m),
        velocity_m_s=_median(pairs.velocity_errors_m_s),
        speed_m_s=_median(rows.object_speeds_m_s),
    )


def _median(values: Float64) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")


def _mean(values: Float64) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")
