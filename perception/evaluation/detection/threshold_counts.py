"""Counts at the score thresholds of KITTI's precision-recall curves, for many weightings of the frames at once."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from perception.evaluation.detection.match_statistics import MatchStatistics
from perception.evaluation.detection.protocol import RECALL_STEPS
from perception.types import Bool, Float64, Int


@dataclass(frozen=True)
class ThresholdCounts:
    """Weighted counts of R weightings of the frames at 41 thresholds, of which the first ones exist.

    Attributes:
        truths: (R,) number of valid objects.
        matches: (R,) number of valid objects that are matched when all detections count.
        is_threshold: (R, 41) whether the threshold exists; there are fewer with few objects or low recall.
        thresholds: (R, 41) score thresholds, falling.
        true_positives: (R, 41) number of true positives at each threshold.
        false_positives: (R, 41) number of false positives at each threshold.
        found_truths: (R, 41) number of valid objects that are no false negatives.
        similarity: (R, 41) similarity of the headings, summed over the true positives.
    """

    truths: Int
    matches: Int
    is_threshold: Bool
    thresholds: Float64
    true_positives: Int
    false_positives: Int
    found_truths: Int
    similarity: Float64

    @property
    def precision(self) -> Float64:
        """(R, 41) precision at recall 0, 1/40 .. 1: each the maximum over this and all higher recalls."""
        return self._envelope(self.true_positives)

    @property
    def orientation_similarity(self) -> Float64:
        """(R, 41) precision with each true positive weighted by the similarity of its heading."""
        return self._envelope(self.similarity)

    def _envelope(self, part: Int | Float64) -> Float64:
        counted = self.true_positives + self.false_positives
        ratios = np.zeros(part.shape)
        np.divide(part, counted, out=ratios, where=self.is_threshold & (counted > 0))
        return np.maximum.accumulate(ratios[:, ::-1], axis=1)[:, ::-1]


def count_at_thresholds(statistics: MatchStatistics, weights: Int) -> ThresholdCounts:
    """Return the counts for (R, F) weights of the frames, such as their multiplicities in R resamples."""
    matched = statistics.matches
    truths = weights @ statistics.truths_of_frames
    found: Int = np.cumsum(weights[:, matched.frames], axis=1, dtype=np.int64)
    matches: Int = found[:, -1] if len(matched) else np.zeros(len(weights), np.int64)
    ranks = np.stack([_ranks_of_recalls(max(count, 1)) for count in truths.tolist()])
    # The last score is the last threshold.
    is_threshold = np.insert(ranks[:, :-1], 0, 0, axis=1) < matches[:, None]
    rows = _first_reaching(found, np.clip(ranks, 1, np.maximum(matches, 1)[:, None]))
    thresholds = matched.scores[rows] if len(matched) else np.zeros(ranks.shape)
    increments = statistics.increments
    last = np.searchsorted(-increments.scores, -thresholds, side="right") - 1
    frame_weights = weights.take(increments.frames, axis=1)

    def count(change: Int | Float64) -> np.ndarray:
        if not len(matched):
            return np.zeros(ranks.shape, change.dtype)
        counts = np.cumsum(change * frame_weights, axis=1)
        return np.take_along_axis(counts, last, axis=1)

    return ThresholdCounts(
        truths=truths,
        matches=matches,
        is_threshold=is_threshold,
        thresholds=thresholds,
        true_positives=count(increments.true_positives),
        false_positives=count(increments.false_positives),
        found_truths=count(increments.found_truths),
        similarity=count(increments.similarity),
    )


def _first_reaching(rising: Int, values: Int) -> Int:
    """Return (R, K) the first column of each of R rising rows of M numbers that reaches each of its K values.

    Where none does, the last column is returned.
    """
    count, length = rising.shape
    apart = np.arange(count)[:, None] * (max(rising.max(initial=0), values.max(initial=0)) + 1)
    # The rows one above the other are a single rising row.
    places = np.searchsorted((rising + apart).ravel(), (values + apart).ravel())
    columns = places.reshape(values.shape) - np.arange(count)[:, None] * length
    return np.asarray(np.minimum(columns, max(length - 1, 0)), np.int64)


def threshold_ranks(matches: int, truths: int) -> Int:
    """Return the ranks, from 1, of the falling scores that become thresholds.

    For each recall c in turn, the threshold is the first score whose recall i/n is nearer to c than the recall
    (i+1)/n of the next score: (i+1)/n - c >= c - i/n. The last score is always a threshold. The official tool
    accumulates c and compares in floating point, which decides between equals.
    """
    if matches == 0:
        return np.zeros(0, np.int64)
    ranks = _ranks_of_recalls(truths)
    return np.minimum(ranks[: np.searchsorted(ranks, matches) + 1], matches)


@cache
def _ranks_of_recalls(truths: int) -> Int:
    """Return the (41,) rising ranks of the thresholds where every object is matched."""
    recalls = np.cumsum(np.append(0.0, np.full(RECALL_STEPS, 1 / RECALL_STEPS)))
    near = np.ceil(recalls * truths - 0.5).astype(np.int64)
    tried = near[:, None] + np.arange(-2, 3)
    is_too_soon = (tried + 1) / truths - recalls[:, None] < recalls[:, None] - tried / truths
    firsts = np.maximum(near - 2 + is_too_soon.sum(axis=1), 1)
    # Each score is a threshold only once: the next recall continues behind it.
    numbers = np.arange(len(firsts))
    return np.asarray(np.maximum.accumulate(firsts - numbers) + numbers, np.int64)
