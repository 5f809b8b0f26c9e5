"""CLEAR: misses, false tracks and exchanged identities at one threshold of likeness.

K. Bernardin, R. Stiefelhagen, "Evaluating Multiple Object Tracking Performance: The CLEAR MOT Metrics",
EURASIP JIVP 2008; mostly tracked and lost after Y. Li et al., CVPR 2009.
"""

from dataclasses import astuple, dataclass

import numpy as np

from perception.evaluation.multi_object.matching import matching_components
from perception.evaluation.multi_object.pairs import BoxPairs, group_by_track, pair_boxes
from perception.evaluation.multi_object.sequence import TrackedSequence
from perception.types import Bool, Int

# What a pair of the frame before gains over all others: more than any sum of likeness in a frame.
_CONTINUED = 1000.0


@dataclass(frozen=True)
class Clear:
    """Counts at one threshold; add them up over sequences. Ratios of nothing are 0.

    Attributes:
        true_positives: matched boxes.
        false_positives: answered boxes without a truth.
        false_negatives: true boxes without an answer.
        id_switches: how often an object's track is another than its last one.
        fragmentations: how often an object is found again after a frame in which it was not.
        mostly_tracked: objects found in more than 80 % of their frames.
        partly_tracked: in 20 % and more.
        mostly_lost: in less.
        similarity_sum: over the matched boxes.
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

    def __add__(self, other: "Clear") -> "Clear":
        """Return the counts of both."""
        return Clear(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))

    @property
    def mota(self) -> float:
        """Accuracy: 1 less the share of misses, false boxes and switches."""
        return self._accuracy(self.true_positives - self.id_switches)

    @property
    def moda(self) -> float:
        """The same without switches."""
        return self._accuracy(self.true_positives)

    @property
    def smota(self) -> float:
        """The same as MOTA, where a matched box counts as much as it is alike."""
        return self._accuracy(self.similarity_sum - self.id_switches)

    @property
    def motp(self) -> float:
        """Mean similarity of the matched boxes: 1 is best."""
        return _ratio(self.similarity_sum, self.true_positives)

    @property
    def recall(self) -> float:
        """Share of the true boxes that were found."""
        return _ratio(self.true_positives, self.true_positives + self.false_negatives)

    @property
    def precision(self) -> float:
        """Share of the answered boxes that are true."""
        return _ratio(self.true_positives, self.true_positives + self.false_positives)

    def _accuracy(self, earned: float) -> float:
        true_boxes = self.true_positives + self.false_negatives
        return _ratio(earned - self.false_positives, true_boxes)


def clear(sequence: TrackedSequence, threshold: float = 0.5) -> Clear:
    """Measure one sequence; several are combined by adding their results.

    Args:
        sequence: frames in order.
        threshold: of similarity, from which on two boxes may be the same.
    """
    paired = pair_boxes(sequence, threshold)
    matched = paired.pairs[_match_frames(paired.pairs)]
    true_positives = len(matched.truths)
    found = np.bincount(matched.truths, minlength=len(paired.truth_lengths))
    # In whole numbers: 80 % of five frames is four of them.
    is_mostly = 5 * found > 4 * paired.truth_lengths
    is_lost = 5 * found < paired.truth_lengths
    # The matches of each object in turn: what follows on what.
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
    """Match frame after frame: who was matched in the frame before stays so if still alike enough."""
    before = _pair_before(pairs)
    is_matched = np.ones(len(before), bool)
    for group in matching_components(pairs.truth_boxes, pairs.track_boxes):
        earlier = before[group.pairs]
        is_continued = (earlier >= 0) & is_matched[earlier]
        weights = _CONTINUED * is_continued + pairs.similarity[group.pairs]
        is_matched[group.pairs] = group.max_weight(weights)
    return is_matched


def _pair_before(pairs: BoxPairs) -> Int:
    """Return (C,) which pair is of the same object and track one moment earlier, or -1."""
    track_pairs = group_by_track(pairs).pair_ids
    order = np.lexsort((pairs.timesteps, track_pairs))
    is_next = (np.diff(track_pairs[order]) == 0) & (np.diff(pairs.timesteps[order]) == 1)
    before = np.full(len(order), -1)
    before[order[1:][is_next]] = order[:-1][is_next]
    return before


def _ratio(part: float, whole: int) -> float:
    return part / whole if whole else 0.0
