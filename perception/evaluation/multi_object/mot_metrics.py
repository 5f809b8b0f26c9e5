"""The three measures of one sequence, or of several, together."""

from dataclasses import dataclass, field

from perception.evaluation.multi_object.clear import Clear, clear
from perception.evaluation.multi_object.hota import Hota, hota
from perception.evaluation.multi_object.identity import Identity, identity
from perception.evaluation.multi_object.sequence import TrackedSequence


@dataclass(frozen=True)
class MotMetrics:
    """What tracks are worth; add them up over sequences.

    Attributes:
        hota: over all thresholds.
        clear: at one.
        identity: at the same.
    """

    hota: Hota = field(default_factory=Hota)
    clear: Clear = field(default_factory=Clear)
    identity: Identity = field(default_factory=Identity)

    def __add__(self, other: "MotMetrics") -> "MotMetrics":
        """Return the scores of both, as of one longer sequence."""
        return MotMetrics(
            self.hota + other.hota, self.clear + other.clear, self.identity + other.identity
        )


def evaluate_tracks(sequence: TrackedSequence, threshold: float = 0.5) -> MotMetrics:
    """Measure one sequence.

    Args:
        sequence: frames in order.
        threshold: of similarity, for CLEAR and identity.
    """
    return MotMetrics(hota(sequence), clear(sequence, threshold), identity(sequence, threshold))
