"""False tracks: those that match no object in more than half of their frames."""

from dataclasses import dataclass

import numpy as np

from perception.evaluation.multi_object.track_assignment import FrameAssignment
from perception.types import ArrayTable, Bool, Int, Tracks


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
class FalseTracks:
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
    per_minute: float


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
