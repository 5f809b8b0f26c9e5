"""Errors of the tracks of objects that must be tracked: position, velocity, heading and extent."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.evaluation.multi_object.moving_scene import MovingScene
from perception.evaluation.multi_object.track_assignment import FrameAssignment
from perception.evaluation.report import Column
from perception.types import ArrayTable, Float64, Int, Tracks

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
    def matched(self) -> Self:
        """Rows with a matched track."""
        return self[self.track_ids != NO_TRACK]

    def by_object(self) -> dict[int, Self]:
        """Return the rows of each object by its id, in ascending order."""
        return {int(n): self[self.object_ids == n] for n in np.unique(self.object_ids)}

    @property
    def switches(self) -> int:
        """Number of times that the matched track changes, of the rows of one object."""
        return int(np.count_nonzero(np.diff(self.matched.track_ids)))

    @property
    def time_to_first_track_s(self) -> float:
        """Time from the first row to the first match, of the rows of one object; NaN without a match."""
        return _median(self.matched.stamps_s[:1] - self.stamps_s[0])


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


_HEADING_SPEED_M_S = 1.0  # the heading of a slower track is not defined by its motion


def _median(values: Float64) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")


def _mean(values: Float64) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


def _heading_error_rad(errors: TargetErrors) -> float:
    is_fast = errors.track_speeds_m_s > _HEADING_SPEED_M_S
    return _median(errors.heading_errors_rad[is_fast])


_Errors = Column[TargetErrors]
_CENTER = _Errors("centre [m]", lambda e: _median(e.center_errors_m), ".3f", "center_m")
_VELOCITY = _Errors(
    "velocity [m/s]", lambda e: _median(e.velocity_errors_m_s), ".3f", "velocity_m_s"
)

# Medians of position, velocity and heading, means of the extent, over all matched rows.
ERROR_COLUMNS = (
    _CENTER,
    _VELOCITY,
    _Errors("mean [m/s]", lambda e: _mean(e.velocity_errors_m_s), ".3f", "mean_velocity_m_s"),
    _Errors("heading [rad]", _heading_error_rad, ".3f", "heading_rad"),
    _Errors("length [m]", lambda e: _mean(np.abs(e.length_errors_m)), ".3f", "length_m"),
    _Errors("width [m]", lambda e: _mean(np.abs(e.width_errors_m)), ".3f", "width_m"),
)

# Of the rows of one object.
OBJECT_COLUMNS = (
    _Errors("[m/s]", lambda e: _median(e.object_speeds_m_s), ".1f", "speed_m_s"),
    _Errors("frames", len, "", "frames"),
    _Errors("tracked", lambda e: len(e.matched), "", "frames_tracked"),
    _Errors("tracked [%]", lambda e: 100 * len(e.matched) / len(e), ".0f", "tracked_percent"),
    _Errors("ids", lambda e: len(np.unique(e.matched.track_ids)), "", "tracks"),
    _Errors("switches", lambda e: e.switches, "", "switches"),
    _Errors(
        "time to first track [s]",
        lambda e: e.time_to_first_track_s,
        ".1f",
        "time_to_first_track_s",
    ),
    _CENTER,
    _VELOCITY,
)
