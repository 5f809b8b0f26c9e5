"""CLEAR MOT metrics: misses, false positives and identity switches at one threshold of similarity.

K. Bernardin, R. Stiefelhagen, "Evaluating Multiple Object Tracking Performance: The CLEAR MOT Metrics",
EURASIP JIVP 2008; mostly tracked and lost after Y. Li et al., CVPR 2009.
"""

from dataclasses import dataclass

import numpy as np

from perception.evaluation.multi_object.matching import best_matching, competing_pairs
from perception.evaluation.multi_object.sequence import (
    BoxPairs,
    TrackedSequence,
    group_by_track,
    pair_boxes,
)
from perception.evaluation.report import SummedMetrics
from perception.types import Bool, Int

# Bonus of a pair that was matched in the previous frame: more than any sum of similarities in a frame.
_CONTINUED = 1000.0


@dataclass(frozen=True)
class Clear(SummedMetrics):
    """Counts at one threshold; those of several sequences are added. Ratios without a denominator are 0.

    Attributes:
        true_positives: Number of matched boxes.
        false_positives: Number of predicted boxes without a true box.
        false_negatives: Number of true boxes without a predicted box.
        id_switches: Number of times that an object is matched to another track than before.
        fragmentations: Number of times that an object is matched again after a frame without a match.
        mostly_tracked: Number of objects matched in more than 80 % of their frames.
        partly_tracked: Number of objects matched in 20 % to 80 % of their frames.
        mostly_lost: Number of objects matched in less than 20 % of their frames.
        similarity_sum: Sum of the similarity over the matched boxes.
    """

    true_positives: int = 0
    false_positives: int = 0
    false_negatives: int = 0
    id_switches: int = 0
    fragmentations: int = 0
    mostly_tracked: int = 0
    partly_tracked: int = 0
    mostly_lost: int = 0
    similarity_sum: float = 0.0

    @property
    def mota(self) -> float:
        """Accuracy: 1 less the share of misses, false positives and switches."""
        return self._accuracy(self.true_positives - self.id_switches)

    @property
    def moda(self) -> float:
        """Accuracy without switches."""
        return self._accuracy(self.true_positives)

    @property
    def smota(self) -> float:
        """Accuracy with matched boxes weighted by their similarity."""
        return self._accuracy(self.similarity_sum - self.id_switches)

    @property
    def motp(self) -> float:
        """Mean similarity of the matched boxes: 1 is best."""
        return ratio(self.similarity_sum, self.true_positives)

    def _accuracy(self, earned: float) -> float:
        true_boxes = self.true_positives + self.false_negatives
        return ratio(earned - self.false_positives, true_boxes)


def clear(sequence: TrackedSequence, threshold: float = 0.5) -> Clear:
    """Measure one sequence; several are combined by adding their results.

    Args:
        sequence: Frames in order.
        threshold: Similarity from which on two boxes may be matched.
    """
    paired = pair_boxes(sequence, threshold)
    matched = paired.pairs[_match_frames(paired.pairs)]
    true_positives = len(matched.truths)
    found = np.bincount(matched.truths, minlength=len(paired.truth_lengths))
    # In integers: 80 % of five frames is four of them.
    is_mostly = 5 * found > 4 * paired.truth_lengths
    is_lost = 5 * found < paired.truth_lengths
    # The matches of each object in order of time.
    by_object = np.lexsort((matched.timesteps, matched.truths))
    is_same = np.diff(matched.truths[by_object]) == 0
    has_other_track = np.diff(matched.tracks[by_object]) != 0
    has_gap = np.diff(matched.timesteps[by_object]) > 1
    return Clear(
        true_positives=true_positives,
        false_positives=int(paired.track_lengths.sum()) - true_positives,
        false_negatives=int(paired.truth_lengths.sum()) - true_positives,
        id_switches=int(np.count_nonzero(is_same & has_other_track)),
        fragmentations=int(np.count_nonzero(is_same & has_gap)),
        mostly_tracked=int(np.count_nonzero(is_mostly)),
        partly_tracked=int(np.count_nonzero(~is_mostly & ~is_lost)),
        mostly_lost=int(np.count_nonzero(is_lost)),
        similarity_sum=float(matched.similarity.sum()),
    )


def _match_frames(pairs: BoxPairs) -> Bool:
    """Match frame by frame: a pair of the previous frame is kept while its similarity is high enough."""
    rows, columns, before = pairs.truth_boxes, pairs.track_boxes, _pair_before(pairs)
    is_matched = np.ones(len(before), bool)
    for group in competing_pairs(rows, columns):
        earlier = before[group]
        is_continued = (earlier >= 0) & is_matched[earlier]
        weights = _CONTINUED * is_continued + pairs.similarity[group]
        is_matched[group] = best_matching(rows[group], columns[group], weights)
    return is_matched


def _pair_before(pairs: BoxPairs) -> Int:
    """Return (C,) index of the pair of the same object and track one timestep earlier, or -1."""
    track_pairs = group_by_track(pairs).pair_ids
    order = np.lexsort((pairs.timesteps, track_pairs))
    is_next = (np.diff(track_pairs[order]) == 0) & (np.diff(pairs.timesteps[order]) == 1)
    before = np.full(len(order), -1)
    before[order[1:][is_next]] = order[:-1][is_next]
    return before


def ratio(part: float, whole: int) -> float:
    """Return a ratio of counts, 0 of nothing."""
    return part / whole if whole else 0.0
