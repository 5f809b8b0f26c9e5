"""Input of the tracking metrics: ids and similarity of true objects and tracks, frame by frame and as flat arrays.

As flat arrays, G true objects and T tracks are numbered from 0 in place of their ids, boxes are numbered through
all frames: every metric is then a few sums over C pairs, however long the sequence.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar, cast

import numpy as np

from perception.errors import PerceptionError
from perception.types import ArrayTable, Bool, Float64, Int

Array = TypeVar("Array", Int, Float64)

# A similarity equal to a threshold counts, also where rounding took its last digit.
_ROUNDING = np.finfo(np.float64).eps
_TOLERANCE = 1e-9  # of similarities above 1


@dataclass(frozen=True)
class TrackedFrame:
    """G true objects and T tracks of one frame that are evaluated.

    Attributes:
        truth_ids: (G,) Ids of the objects, each once.
        track_ids: (T,) Ids of the tracks, each once.
        similarity: (G, T) Similarity from 0 to 1: IoU, or one that falls with the distance.
    """

    truth_ids: Int
    track_ids: Int
    similarity: Float64

    def __post_init__(self) -> None:
        """Validate the shape and range of the similarity, and that ids occur once."""
        shape = (len(self.truth_ids), len(self.track_ids))
        if self.similarity.shape != shape:
            raise PerceptionError(
                "TrackedFrame.similarity",
                expected=f"shape {shape}",
                found=f"shape {self.similarity.shape}",
            )
        if not ((self.similarity >= 0) & (self.similarity <= 1 + _TOLERANCE)).all():
            raise PerceptionError(
                "TrackedFrame.similarity",
                expected="values from 0 to 1",
                found=f"{self.similarity.min()} to {self.similarity.max()}",
            )
        _require_each_once("truth_ids", self.truth_ids)
        _require_each_once("track_ids", self.track_ids)


def _require_each_once(name: str, ids: Int) -> None:
    if len(set(ids.tolist())) < len(ids):
        values, counts = np.unique(ids, return_counts=True)
        raise PerceptionError(
            f"TrackedFrame.{name}",
            expected="every id once",
            found=f"id {values[counts.argmax()]} {counts.max()} times",
        )


TrackedSequence = Sequence[TrackedFrame]


@dataclass(frozen=True)
class BoxPairs(ArrayTable):
    """C pairs of a true and a predicted box of the same frame, in the order of frames.

    Attributes:
        truths: (C,) Number of the true object.
        tracks: (C,) Number of the track.
        truth_boxes: (C,) Number of the true box.
        track_boxes: (C,) Number of the predicted box.
        timesteps: (C,) Number of the frame, among those with both true and predicted boxes.
        similarity: (C,) Similarity above 0.
    """

    truths: Int
    tracks: Int
    truth_boxes: Int
    track_boxes: Int
    timesteps: Int
    similarity: Float64


@dataclass(frozen=True)
class PairedSequence:
    """Pairs of a sequence, and the lengths of its objects and tracks.

    Attributes:
        truth_lengths: (G,) Number of frames of each true object.
        track_lengths: (T,) Number of frames of each track.
        pairs: Pairs of similar boxes.
    """

    truth_lengths: Int
    track_lengths: Int
    pairs: BoxPairs


def pair_boxes(sequence: TrackedSequence, threshold: float = 0.0) -> PairedSequence:
    """Find all pairs of a similarity above 0 and at or above a threshold."""
    truths = _numbered([frame.truth_ids for frame in sequence])
    tracks = _numbered([frame.track_ids for frame in sequence])
    similarity = _joined([frame.similarity.ravel() for frame in sequence], np.float64)
    heights = np.array([len(frame.truth_ids) for frame in sequence], np.int64)
    widths = np.array([len(frame.track_ids) for frame in sequence], np.int64)
    kept = np.flatnonzero((similarity > 0) & (similarity >= threshold - _ROUNDING))
    # The frame and the place in its (G, T) table of each kept value.
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
    """K combinations of a true object and a track with similar boxes in at least one frame.

    Attributes:
        truths: (K,) Number of the true object.
        tracks: (K,) Number of the track.
        pair_ids: (C,) Number of the combination that each pair of boxes belongs to.
    """

    truths: Int
    tracks: Int
    pair_ids: Int

    def sums(self, weights: Float64 | Bool) -> Float64:
        """Return (K,) sums of the (C,) weights of pairs of boxes."""
        return np.bincount(self.pair_ids, weights, len(self.truths)).astype(np.float64)


def group_by_track(pairs: BoxPairs) -> TrackPairs:
    """Group pairs of boxes by object and track."""
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
