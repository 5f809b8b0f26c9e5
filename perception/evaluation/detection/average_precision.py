"""Average precision by KITTI's 2D protocol, and its bootstrap intervals over the choice of frames.

A precision-recall curve has 41 points, at thresholds that are scores of matched detections. Bootstrap: B. Efron,
"Bootstrap methods: another look at the jackknife", Annals of Statistics 1979: each resample draws as many frames as
there are, with replacement; the interval holds the middle share of the resampled averages.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from perception.errors import UsageError
from perception.evaluation.detection.config import RECALL_POINTS
from perception.evaluation.detection.evaluation_boxes import EvaluationBoxes
from perception.evaluation.detection.match_statistics import MatchStatistics, match_statistics
from perception.evaluation.detection.protocol import (
    DIFFICULTIES,
    KITTI_CLASSES,
    RECALL_STEPS,
    DetectionClass,
    Difficulty,
)
from perception.types import Float64, Int, Progress

# Points of the average precision: recall 0, 0.1 .. 1 until 2019, then 1/40, 2/40 .. 1.
_RECALL_SLICES: dict[int, slice] = {11: slice(0, None, 4), 40: slice(1, None)}


@dataclass(frozen=True)
class PrecisionCurve:
    """Precision at up to 41 score thresholds of rising recall.

    Precision at a point is the maximum over this and all higher recalls. With few objects or low recall there
    are fewer than 41 thresholds, and precision is 0 beyond them.

    Attributes:
        truths: Number of valid objects.
        matches: Number of valid objects that are matched when all detections count.
        thresholds: (K,) score thresholds, falling.
        true_positives: (K,) number of true positives at each threshold.
        false_positives: (K,) number of false positives at each threshold.
        false_negatives: (K,) number of false negatives at each threshold.
        precision: (41,) precision, 0 to 1, at recall 0, 1/40 .. 1.
        orientation_similarity: (41,) precision in which each true positive is weighted by the similarity of its
            heading, 0 to 1; None where a detection has no heading.
    """

    truths: int
    matches: int
    thresholds: Float64
    true_positives: Int
    false_positives: Int
    false_negatives: Int
    precision: Float64
    orientation_similarity: Float64 | None

    def ap(self, recall_points: int = 40) -> float:
        """Return the average precision in percent."""
        return 100 * float(self.precision[_RECALL_SLICES[recall_points]].mean())

    def aos(self, recall_points: int = 40) -> float | None:
        """Return the average orientation similarity in percent; None without headings."""
        if self.orientation_similarity is None:
            return None
        return 100 * float(self.orientation_similarity[_RECALL_SLICES[recall_points]].mean())


def compute_curve(
    match_statistics: MatchStatistics, *, has_orientation: bool, frame_weights: Int | None = None
) -> PrecisionCurve:
    """Return the curve of one class at one difficulty.

    Args:
        match_statistics: Matches of one class at one difficulty.
        has_orientation: Whether all detections have headings.
        frame_weights: (F,) multiplicity of each frame in a resample; None for all frames once.
    """
    weights = (
        np.ones_like(match_statistics.truths_of_frames) if frame_weights is None else frame_weights
    )
    truths = int(weights @ match_statistics.truths_of_frames)
    found = np.cumsum(weights[match_statistics.matches.frames])
    matches = int(found[-1]) if len(found) else 0
    places = threshold_ranks(matches, truths)
    thresholds = match_statistics.matches.scores[np.searchsorted(found, places)]
    increments, increment_weights = (
        match_statistics.increments,
        weights[match_statistics.increments.frames],
    )
    last = np.searchsorted(-increments.scores, -thresholds, side="right") - 1

    def count(change: Int | Float64) -> np.ndarray:
        return np.cumsum(change * increment_weights)[last]

    right, wrong = count(increments.true_positives), count(increments.false_positives)
    similarity = count(increments.similarity) if has_orientation else None
    return PrecisionCurve(
        truths=truths,
        matches=matches,
        thresholds=thresholds,
        true_positives=right,
        false_positives=wrong,
        false_negatives=truths - count(increments.found_truths),
        precision=_envelope(right, right + wrong),
        orientation_similarity=None if similarity is None else _envelope(similarity, right + wrong),
    )


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


def max_ap(truths: int, recall_points: int = 40) -> float:
    """Return the average precision in percent of a perfect detector.

    It is 100 with many objects. With 40 objects or fewer there are fewer than 41 thresholds, and precision is 0
    beyond the last, as with the official tool.
    """
    precision = np.zeros(RECALL_STEPS + 1)
    precision[: len(threshold_ranks(truths, truths))] = 1
    return 100 * float(precision[_RECALL_SLICES[recall_points]].mean())


def _envelope(part: Int | Float64, whole: Int) -> Float64:
    """Return (41,) ratios, each the maximum of it and those after it; 0 where the whole is 0."""
    ratios = np.zeros(RECALL_STEPS + 1)
    np.divide(part, whole, out=ratios[: len(whole)], where=whole > 0)
    return np.maximum.accumulate(ratios[::-1])[::-1]


# Precision-recall curves by difficulty; none where nothing of the class was detected.
ClassCurves = dict[str, PrecisionCurve]
DetectionMetrics = dict[DetectionClass, ClassCurves]


@dataclass(frozen=True)
class ClassMatches:
    """Matches of one class in all frames, from which the curves of any bootstrap resample follow.

    Attributes:
        frames: Number of frames.
        has_orientation: Whether every detection, of any class, has a heading.
        by_difficulty: Matches by difficulty; none where nothing of the class was detected.
    """

    frames: int
    has_orientation: bool
    by_difficulty: dict[str, MatchStatistics]

    def curves(self, frame_weights: Int | None = None) -> ClassCurves:
        """Return the curves of all frames, or of a resample with (F,) multiplicities of the frames."""
        return {
            name: compute_curve(
                matches, has_orientation=self.has_orientation, frame_weights=frame_weights
            )
            for name, matches in self.by_difficulty.items()
        }


def match_detections(
    boxes: EvaluationBoxes,
    classes: Sequence[DetectionClass] = KITTI_CLASSES,
    difficulties: Sequence[Difficulty] = DIFFICULTIES,
) -> dict[DetectionClass, ClassMatches]:
    """Match the boxes of all frames for every class and difficulty."""
    matches = {}
    for of_class in classes:
        found = difficulties if boxes.has_detections_of(of_class) else ()
        statistics = {one.name: match_statistics(boxes, of_class, one) for one in found}
        matches[of_class] = ClassMatches(boxes.frames, boxes.has_orientation, statistics)
    return matches


def kitti_average_precision(
    boxes: EvaluationBoxes,
    classes: Sequence[DetectionClass] = KITTI_CLASSES,
    difficulties: Sequence[Difficulty] = DIFFICULTIES,
) -> DetectionMetrics:
    """Return the precision-recall curves of each class by KITTI's 2D protocol.

    As with the official tool, a class without detections has no metrics, and a class without labels has an
    average precision of 0.
    """
    matches = match_detections(boxes, classes, difficulties)
    return {of_class: one.curves() for of_class, one in matches.items()}


@dataclass(frozen=True)
class Interval:
    """Interval of the average precision in percent; NaN where no resample holds an object."""

    low: float
    high: float


NO_INTERVAL = Interval(np.nan, np.nan)


@dataclass(frozen=True)
class PrecisionSamples:
    """Averages in percent of N bootstrap resamples, by number of recall points; NaN of one without an object.

    Attributes:
        ap: (N,) average precision.
        aos: (N,) average orientation similarity, NaN without headings.
    """

    ap: Mapping[int, Float64]
    aos: Mapping[int, Float64]


def percentile_interval(percent: Float64, confidence: float = 0.95) -> Interval:
    """Return the percentile interval of (N,) averages or of their differences."""
    known = percent[~np.isnan(percent)]
    if len(known) == 0:
        return NO_INTERVAL
    low, high = np.quantile(known, [(1 - confidence) / 2, (1 + confidence) / 2])
    return Interval(float(low), float(high))


def resample_precision(
    matches: ClassMatches, resamples: int, generator: np.random.Generator, progress: Progress = iter
) -> dict[str, PrecisionSamples]:
    """Return the average precision of bootstrap resamples by difficulty, the same resamples for all of them.

    Args:
        matches: Matches of one class in all frames.
        resamples: Number of resamples.
        generator: Random generator of the resamples.
        progress: Iterates over the resamples and may show a progress bar.

    Raises:
        UsageError: there is no frame or no resample.
    """
    if resamples < 1 or matches.frames < 1:
        raise UsageError(
            "bootstrap",
            expected="at least one resample of at least one frame",
            found=f"{resamples} resamples of {matches.frames} frames",
        )
    curves = []
    for _ in progress(range(resamples)):
        drawn = generator.integers(matches.frames, size=matches.frames)
        curves.append(matches.curves(np.bincount(drawn, minlength=matches.frames)))
    return {name: _samples([one[name] for one in curves]) for name in matches.by_difficulty}


def _samples(curves: Sequence[PrecisionCurve]) -> PrecisionSamples:
    known = [one if one.truths else None for one in curves]
    ap = {points: [one.ap(points) if one else None for one in known] for points in RECALL_POINTS}
    aos = {points: [one.aos(points) if one else None for one in known] for points in RECALL_POINTS}
    return PrecisionSamples(_as_arrays(ap), _as_arrays(aos))


def _as_arrays(samples: Mapping[int, Sequence[float | None]]) -> dict[int, Float64]:
    return {points: np.array(one, np.float64) for points, one in samples.items()}
