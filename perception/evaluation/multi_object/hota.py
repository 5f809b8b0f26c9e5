"""HOTA: detection, association and localisation in one metric, over all thresholds of similarity.

J. Luiten et al., "HOTA: A Higher Order Metric for Evaluating Multi-Object Tracking", IJCV 2021.
"""

from dataclasses import dataclass, field

import numpy as np

from perception.evaluation.multi_object.matching import max_weight_matching
from perception.evaluation.multi_object.sequence import (
    PairedSequence,
    TrackedSequence,
    TrackPairs,
    group_by_track,
    pair_boxes,
)
from perception.evaluation.report import SummedMetrics
from perception.types import Float64, Int

ALPHAS: Float64 = np.arange(1, 20) / 20
_ROUNDING = np.finfo(np.float64).eps


def _no_counts() -> Int:
    return np.zeros(len(ALPHAS), np.int64)


def _no_sums() -> Float64:
    return np.zeros(len(ALPHAS))


@dataclass(frozen=True)
class Hota(SummedMetrics):
    """Counts and sums at the 19 thresholds of similarity `ALPHAS`, 0.05 to 0.95; those of several sequences are added.

    Ratios without a denominator are 0, except the localisation accuracy, which is 1. Every ratio
    is an array (19,); the metric that is reported is its mean over the thresholds.

    Attributes:
        true_positives: (19,) Number of matched boxes.
        false_negatives: (19,) Number of true boxes without a predicted box.
        false_positives: (19,) Number of predicted boxes without a true box.
        association_sum: (19,) Sum over the true positives of the IoU in time of their object and track.
        association_recall_sum: (19,) Sum over the true positives of their share of the object's frames.
        association_precision_sum: (19,) Sum over the true positives of their share of the track's frames.
        similarity_sum: (19,) Sum of the similarity over the true positives.
    """

    true_positives: Int = field(default_factory=_no_counts)
    false_negatives: Int = field(default_factory=_no_counts)
    false_positives: Int = field(default_factory=_no_counts)
    association_sum: Float64 = field(default_factory=_no_sums)
    association_recall_sum: Float64 = field(default_factory=_no_sums)
    association_precision_sum: Float64 = field(default_factory=_no_sums)
    similarity_sum: Float64 = field(default_factory=_no_sums)

    @property
    def hota(self) -> Float64:
        """Geometric mean of detection and association accuracy; its mean is not the root of their means."""
        return np.sqrt(self.det_a * self.ass_a)

    @property
    def det_a(self) -> Float64:
        """Detection accuracy: IoU of the true and the predicted boxes as sets."""
        wrong = self.false_negatives + self.false_positives
        return _ratio(self.true_positives, self.true_positives + wrong)

    @property
    def det_re(self) -> Float64:
        """Detection recall."""
        return _ratio(self.true_positives, self.true_positives + self.false_negatives)

    @property
    def det_pr(self) -> Float64:
        """Detection precision."""
        return _ratio(self.true_positives, self.true_positives + self.false_positives)

    @property
    def ass_a(self) -> Float64:
        """Association accuracy: mean IoU in time of an object and its track."""
        return _ratio(self.association_sum, self.true_positives)

    @property
    def ass_re(self) -> Float64:
        """Association recall."""
        return _ratio(self.association_recall_sum, self.true_positives)

    @property
    def ass_pr(self) -> Float64:
        """Association precision."""
        return _ratio(self.association_precision_sum, self.true_positives)

    @property
    def loc_a(self) -> Float64:
        """Localisation accuracy: mean similarity of the true positives, 1 without any."""
        mean = _ratio(self.similarity_sum, self.true_positives)
        return np.where(self.true_positives > 0, mean, 1.0)


def hota(sequence: TrackedSequence) -> Hota:
    """Measure one sequence; several are combined by adding their results."""
    paired = pair_boxes(sequence)
    pairs, track_pairs = paired.pairs, group_by_track(paired.pairs)
    weights = pairs.similarity * _alignment(paired, track_pairs)[track_pairs.pair_ids]
    # One matching serves all thresholds: by association over time, then by similarity.
    is_matched = max_weight_matching(pairs.truth_boxes, pairs.track_boxes, weights)
    is_positive = is_matched & (pairs.similarity >= ALPHAS[:, None] - _ROUNDING)
    true_positives = is_positive.sum(axis=1)
    together = np.stack([track_pairs.sums(row) for row in is_positive])
    truth_lengths = paired.truth_lengths[track_pairs.truths]
    track_lengths = paired.track_lengths[track_pairs.tracks]
    return Hota(
        true_positives=true_positives,
        false_negatives=paired.truth_lengths.sum() - true_positives,
        false_positives=paired.track_lengths.sum() - true_positives,
        association_sum=(together**2 / (truth_lengths + track_lengths - together)).sum(axis=1),
        association_recall_sum=(together**2 / truth_lengths).sum(axis=1),
        association_precision_sum=(together**2 / track_lengths).sum(axis=1),
        similarity_sum=is_positive @ pairs.similarity,
    )


def _alignment(paired: PairedSequence, track_pairs: TrackPairs) -> Float64:
    """Return (K,) alignment of each object and track over the whole sequence, before boxes are matched one to one."""
    pairs = paired.pairs
    by_truth = np.bincount(pairs.truth_boxes, pairs.similarity)[pairs.truth_boxes]
    by_track = np.bincount(pairs.track_boxes, pairs.similarity)[pairs.track_boxes]
    together = track_pairs.sums(pairs.similarity / (by_truth + by_track - pairs.similarity))
    lengths = paired.truth_lengths[track_pairs.truths] + paired.track_lengths[track_pairs.tracks]
    return np.asarray(together / (lengths - together))


def _ratio(part: Int | Float64, whole: Int) -> Float64:
    return np.asarray(part / np.maximum(whole, 1))
