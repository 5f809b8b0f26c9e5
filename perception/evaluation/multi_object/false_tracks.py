"""Tracks of nothing that moves: those that follow nobody for most of their lives."""

from dataclasses import dataclass

import numpy as np

from perception.evaluation.multi_object.moving_objects import Judgement
from perception.evaluation.rows import Rows
from perception.types import Bool, Int, Tracks


@dataclass(frozen=True)
class TrackVerdicts(Rows):
    """K tracks that are judged or excused, each in one frame.

    Attributes:
        track_ids: (K,)
        is_right: (K,) whether it follows an object, be it one that need not be tracked.
        is_on_parked: (K,) whether it has no object and lies on a parked one.
    """

    track_ids: Int
    is_right: Bool
    is_on_parked: Bool


def verdicts(tracks: Tracks, judgement: Judgement) -> TrackVerdicts:
    """Say of every track of one frame that counts whether it follows anybody."""
    rows = np.append(judgement.judged, judgement.excused)
    right = np.append(judgement.pair_tracks, judgement.excused)
    return TrackVerdicts(tracks.ids[rows], np.isin(rows, right), np.isin(rows, judgement.on_parked))


@dataclass(frozen=True)
class FalseTracks:
    """Tracks that follow nobody in more than half of the frames in which they count.

    Attributes:
        ids: of the tracks.
        never_right: of these, those that never follow anybody.
        on_parked: of these, those that lie on a parked object in some frame.
        per_minute: tracks over the time evaluated; NaN of no time.
    """

    ids: Int
    never_right: Int
    on_parked: Int
    per_minute: float


def find_false_tracks(found: TrackVerdicts, duration_s: float) -> FalseTracks:
    """Find the false tracks of any number of frames, of a duration in all."""
    ids, row_of = np.unique(found.track_ids.astype(np.int64), return_inverse=True)
    frames = np.bincount(row_of, minlength=len(ids))
    frames_right = np.bincount(row_of, found.is_right, minlength=len(ids))
    false = ids[2 * frames_right < frames]
    return FalseTracks(
        ids=false,
        never_right=ids[frames_right == 0],
        on_parked=np.intersect1d(false, found.track_ids[found.is_on_parked.astype(bool)]),
        per_minute=60 * len(false) / duration_s if duration_s else float("nan"),
    )
