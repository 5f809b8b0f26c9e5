"""Tracks of nothing that moves: those that follow nobody for most of their lives."""

from dataclasses import dataclass

import numpy as np

from perception.evaluation.multi_object.track_assignment import FrameAssignment
from perception.evaluation.rows import Rows
from perception.types import Bool, Int, Tracks


@dataclass(frozen=True)
class TrackOutcomes(Rows):
    """K tracks that are judged or excused, each in one frame.

    Attributes:
        track_ids: (K,)
        is_matched: (K,) whether it follows an object, be it one that need not be tracked.
        is_on_parked: (K,) whether it has no object and lies on a parked one.
    """

    track_ids: Int
    is_matched: Bool
    is_on_parked: Bool


def track_outcomes(tracks: Tracks, assignment: FrameAssignment) -> TrackOutcomes:
    """Say of every track of one frame that counts whether it follows anybody."""
    rows = np.append(assignment.evaluated, assignment.ignored)
    matched = np.append(assignment.matched_tracks, assignment.ignored)
    return TrackOutcomes(
        tracks.ids[rows], np.isin(rows, matched), np.isin(rows, assignment.on_parked)
    )


@dataclass(frozen=True)
class FalseTracks:
    """Tracks that follow nobody in more than half of the frames in which they count.

    Attributes:
        ids: of the tracks.
        never_matched: of these, those that never follow anybody.
        on_parked: of these, those that lie on a parked object in some frame.
        per_minute: tracks over the time evaluated; NaN of no time.
    """

    ids: Int
    never_matched: Int
    on_parked: Int
    per_minute: float


def find_false_tracks(found: TrackOutcomes, duration_s: float) -> FalseTracks:
    """Find the false tracks of any number of frames, of a duration in all."""
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
