"""A sequence as flat arrays: its pairs of boxes that are alike, and who they belong to.

G true objects and T tracks are numbered from 0 in place of their ids, boxes are numbered through all
frames: every measure is then a few sums over C pairs, however long the sequence.
"""

from dataclasses import dataclass
from typing import Self, TypeVar, cast

import numpy as np

from perception.evaluation.multi_object.sequence import TrackedSequence
from perception.types import Bool, Float64, Int

Array = TypeVar("Array", Int, Float64)

# A likeness of the threshold itself counts, also where rounding took its last digit.
_ROUNDING = np.finfo(np.float64).eps


@dataclass(frozen=True)
class BoxPairs:
    """C pairs of a true and an answered box of the same frame, in the order of frames.

    Attributes:
        truths: (C,) number of the true object.
        tracks: (C,) number of the track.
        truth_boxes: (C,) number of the true box.
        track_boxes: (C,) number of the answered box.
        timesteps: (C,) number of the frame, among those with both true and answered boxes.
        similarity: (C,) above 0.
    """

    truths: Int
    tracks: Int
    truth_boxes: Int
    track_boxes: Int
    timesteps: Int
    similarity: Float64

    def __getitem__(self, rows: Bool) -> Self:
        """Return the pairs of a mask."""
        return type(self)(
            self.truths[rows],
            self.tracks[rows],
            self.truth_boxes[rows],
            self.track_boxes[rows],
            self.timesteps[rows],
            self.similarity[rows],
        )


@dataclass(frozen=True)
class PairedSequence:
    """All that the measures need of a sequence.

    Attributes:
        truth_lengths: (G,) in how many frames each true object is.
        track_lengths: (T,) in how many frames each track is.
        pairs: that are alike enough.
    """

    truth_lengths: Int
    track_lengths: Int
    pairs: BoxPairs


def pair_boxes(sequence: TrackedSequence, threshold: float = 0.0) -> PairedSequence:
    """Find all pairs of a similarity above 0 and not under a threshold."""
    truths = _numbered([frame.truth_ids for frame in sequence])
    tracks = _numbered([frame.track_ids for frame in sequence])
    similarity = _joined([frame.similarity.ravel() for frame in sequence], np.float64)
    heights = np.array([len(frame.truth_ids) for frame in sequence], np.int64)
    widths = np.array([len(frame.track_ids) for frame in sequence], np.int64)
    kept = np.flatnonzero((similarity > 0) & (similarity >= threshold - _ROUNDING))
    # Where in which frame's (G, T) table each kept value stood.
    starts = _starts(heights * widths)
    frames = np.searchsorted(starts, kept, side="right") - 1
    rows, columns = np.divmod(kept - starts[frames], widths[frames])
    truth_boxes = _starts(heights)[frames] + rows
    track_boxes = _starts(widths)[frames] + columns
    timesteps = np.cumsum((heights > 0) & (widths > 0)) - 1
    return PairedSequence(
        truth_lengths=np.bincount(truths),
        track_lengths=np.bincount(tracks),
        pairs=BoxPairs(
            truths=truths[truth_boxes],
            tracks=tracks[track_boxes],
            truth_boxes=truth_boxes,
            track_boxes=track_boxes,
            timesteps=timesteps[frames],
            similarity=similarity[kept],
        ),
    )


@dataclass(frozen=True)
class TrackPairs:
    """K different couples of a true object and a track that were alike in at least one frame.

    Attributes:
        truths: (K,) number of the true object.
        tracks: (K,) number of the track.
        pair_ids: (C,) number of the couple that each pair belongs to.
    """

    truths: Int
    tracks: Int
    pair_ids: Int

    def sums(self, weights: Float64 | Bool) -> Float64:
        """Return (K,) sums of (C,) weights of pairs."""
        return np.bincount(self.pair_ids, weights, len(self.truths)).astype(np.float64)


def group_by_track(pairs: BoxPairs) -> TrackPairs:
    """Find out which pairs are of the same object and track."""
    width = int(pairs.tracks.max(initial=0)) + 1
    keys, pair_ids = np.unique(pairs.truths * width + pairs.tracks, return_inverse=True)
    return TrackPairs(keys // width, keys % width, pair_ids)


def _numbered(ids_of_frames: list[Int]) -> Int:
    """Number ids from 0, over all frames joined."""
    return np.asarray(np.unique(_joined(ids_of_frames, np.int64), return_inverse=True)[1])


def _joined(parts: list[Array], kind: type) -> Array:
    return cast(Array, np.concatenate([np.zeros(0, kind), *parts]))


def _starts(lengths: Int) -> Int:
    return np.concatenate([[0], np.cumsum(lengths)[:-1]])[: len(lengths)].astype(np.int64)
