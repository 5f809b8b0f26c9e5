"""What the tracking measures need of a sequence: who was there, who was answered, how alike they are."""

from collections.abc import Sequence
from dataclasses import dataclass

from perception.errors import PerceptionError
from perception.types import Float64, Int


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
        """Refuse a similarity of another shape."""
        shape = (len(self.truth_ids), len(self.track_ids))
        if self.similarity.shape != shape:
            raise PerceptionError(
                "TrackedFrame.similarity",
                expected=f"shape {shape}",
                found=f"shape {self.similarity.shape}",
            )


TrackedSequence = Sequence[TrackedFrame]
