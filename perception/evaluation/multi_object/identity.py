"""Identity metrics: every true object is assigned one track for the whole sequence, or none.

E. Ristani et al., "Performance Measures and a Data Set for Multi-Target, Multi-Camera Tracking",
ECCV Workshops 2016.
"""

from dataclasses import dataclass

from perception.evaluation.multi_object.matching import max_weight_matching
from perception.evaluation.multi_object.sequence import (
    TrackedSequence,
    group_by_track,
    pair_boxes,
)
from perception.evaluation.report import SummedMetrics


@dataclass(frozen=True)
class Identity(SummedMetrics):
    """Counts at one threshold; those of several sequences are added. Ratios without a denominator are 0.

    Attributes:
        true_positives: Number of frames in which an object overlaps its assigned track, over all objects.
        false_positives: Number of all other predicted boxes.
        false_negatives: Number of all other true boxes.
    """

    true_positives: int = 0
    false_positives: int = 0
    false_negatives: int = 0

    @property
    def idf1(self) -> float:
        """Harmonic mean of identity precision and recall."""
        wrong = self.false_positives + self.false_negatives
        return _ratio(2 * self.true_positives, 2 * self.true_positives + wrong)

    @property
    def idp(self) -> float:
        """Identity precision: share of the predicted boxes."""
        return _ratio(self.true_positives, self.true_positives + self.false_positives)

    @property
    def idr(self) -> float:
        """Identity recall: share of the true boxes."""
        return _ratio(self.true_positives, self.true_positives + self.false_negatives)


def identity(sequence: TrackedSequence, threshold: float = 0.5) -> Identity:
    """Measure one sequence; several are combined by adding their results.

    Args:
        sequence: Frames in order.
        threshold: Similarity from which on two boxes count as overlapping.
    """
    paired = pair_boxes(sequence, threshold)
    track_pairs = group_by_track(paired.pairs)
    overlaps = track_pairs.sums(paired.pairs.similarity > 0)
    # A pair that overlaps in c frames saves c misses and c false positives, so the assignment of least cost
    # is the one of most overlapping frames.
    is_assigned = max_weight_matching(track_pairs.truths, track_pairs.tracks, overlaps)
    true_positives = int(overlaps[is_assigned].sum())
    return Identity(
        true_positives=true_positives,
        false_positives=int(paired.track_lengths.sum()) - true_positives,
        false_negatives=int(paired.truth_lengths.sum()) - true_positives,
    )


def _ratio(part: int, whole: int) -> float:
    return part / whole if whole else 0.0
