"""Input of the tracking metrics: ids of true objects and tracks, and their similarity, frame by frame."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perception.errors import PerceptionError
from perception.types import Float64, Int

_ROUNDING = 1e-9  # tolerance of similarities above 1


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
        if not ((self.similarity >= 0) & (self.similarity <= 1 + _ROUNDING)).all():
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
