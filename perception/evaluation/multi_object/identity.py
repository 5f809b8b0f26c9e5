"""Identity measures: every true object is given one track for the whole sequence, or none.

E. Ristani et al., "Performance Measures and a Data Set for Multi-Target, Multi-Camera Tracking",
ECCV Workshops 2016.
"""

from dataclasses import dataclass

from perception.evaluation.multi_object.matching import max_weight_matching
from perception.evaluation.multi_object.pairs import group_by_track, pair_boxes
from perception.evaluation.multi_object.sequence import TrackedSequence


@dataclass(frozen=True)
class Identity:
    """Counts at one threshold; add them up over sequences. Ratios of nothing are 0.

    Attributes:
        true_positives: boxes at which an object and the track given to it meet.
        false_positives: all other answered boxes.
        false_negatives: all other true boxes.
    """

    true_positives: int = 0
    false_positives: int = 0
    false_negatives: int = 0

    def __add__(self, other: "Identity") -> "Identity":
        """Return the counts of both."""
        return Identity(
            self.true_positives + other.true_positives,
            self.false_positives + other.false_positives,
            self.false_negatives + other.false_negatives,
        )

    @property
    def idf1(self) -> float:
        """Harmonic mean of identity precision and recall."""
        wrong = self.false_positives + self.false_negatives
        return _ratio(2 * self.true_positives, 2 * self.true_positives + wrong)

    @property
    def idp(self) -> float:
        """Identity precision: share of the answered boxes."""
        return _ratio(self.true_positives, self.true_positives + self.false_positives)

    @property
    def idr(self) -> float:
        """Identity recall: share of the true boxes."""
        return _ratio(self.true_positives, self.true_positives + self.false_negatives)


def identity(sequence: TrackedSequence, threshold: float = 0.5) -> Identity:
    """Measure one sequence; several are combined by adding their results.

    Args:
        sequence: frames in order.
        threshold: of similarity, from which on two boxes meet.
    """
    paired = pair_boxes(sequence, threshold)
    track_pairs = group_by_track(paired.pairs)
    meetings = track_pairs.sums(paired.pairs.similarity > 0)
    # A couple that meets c times spares c misses and c false boxes of what both would cost alone:
    # the cheapest assignment is the one with the most meetings.
    is_given = max_weight_matching(track_pairs.truths, track_pairs.tracks, meetings)
    true_positives = int(meetings[is_given].sum())
    return Identity(
        true_positives=true_positives,
        false_positives=int(paired.track_lengths.sum()) - true_positives,
        false_negatives=int(paired.truth_lengths.sum()) - true_positives,
    )


def _ratio(part: int, whole: int) -> float:
    return part / whole if whole else 0.0
