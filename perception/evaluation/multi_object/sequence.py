"""What the tracking measures need of a sequence: who was there, who was answered, how alike they are."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perception.errors import PerceptionError
from perception.types import Float64, Int

_ROUNDING = 1e-9  # by which a likeness may exceed 1


@dataclass(frozen=True)
class TrackedFrame:
    """G true objects and T answered tracks of one frame, after all that is not to be judged has left.

    Attributes:
        truth_ids: (G,) each once.
        track_ids: (T,) each once.
        similarity: (G, T) from 0 to 1: IoU, or a distance turned into a likeness.
    """

    truth_ids: Int
    track_ids: Int
    similarity: Float64

    def __post_init__(self) -> None:
        """Refuse a similarity of another shape or range, and an id that is there twice."""
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
