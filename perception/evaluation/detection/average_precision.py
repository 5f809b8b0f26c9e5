"""Average precision by KITTI's protocol, and its bootstrap intervals over the choice of frames.

A precision-recall curve has 41 points, at thresholds that are scores of matched detections. Bootstrap: B. Efron,
"Bootstrap methods: another look at the jackknife", Annals of Statistics 1979: each resample draws as many frames as
there are, with replacement; the interval holds the middle share of the resampled averages.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from perception.errors import UsageError
from perception.evaluation.detection.evaluation_boxes import EvaluationBoxes
from perception.evaluation.detection.match_statistics import MatchStatistics, match_statistics
from perception.evaluation.detection.protocol import (
    DIFFICULTIES,
    KITTI_CLASSES,
    RECALL_STEPS,
    DetectionClass,
    Difficulty,
)
from perception.evaluation.detection.threshold_counts import (
    ThresholdCounts,
    count_at_thresholds,
    threshold_ranks,
)
from perception.types import Bool, Float64, Int, Progress

# Points of the average precision: recall 0, 0.1 .. 1 until 2019, then 1/40, 2/40 .. 1.
_RECALL_SLICES: dict[int, slice] = {11: slice(0, None, 4), 40: slice(1, None)}
_CACHED_COUNTS = 100_000  # counts of detections in resamples that fit into a processor's cache


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
    statistics: MatchStatistics, weights: Int, *, has_orientation: bool
) -> PrecisionCurve:
    """Return the curve of one class at one difficulty.

    Args:
        statistics: Matches of one class at one difficulty.
        weights: (F,) multiplicity of each frame.
        has_orientation: Whether all detections have headings.
    """
    counts = count_at_thresholds(statistics, weights[None])
    exists, truths = counts.is_threshold, int(counts.truths[0])
    return PrecisionCurve(
        truths=truths,
        matches=int(counts.matches[0]),
        thresholds=counts.thresholds[exists],
        true_positives=counts.true_positives[exists],
        false_positives=counts.false_positives[exists],
        false_negatives=truths - counts.found_truths[exists],
        precision=counts.precision[0],
        orientation_similarity=counts.orientation_similarity[0] if has_orientation else None,
    )


def max_ap(truths: int, recall_points: int = 40) -> float:
    """Return the average precision in percent of a perfect detector.

    It is 100 with many objects. With 40 objects or fewer there are fewer than 41 thresholds, and precision is 0
    beyond the last, as with the official tool.
    """
    precision = np.zeros(RECALL_STEPS + 1)
    precision[: len(threshold_ranks(truths, truths))] = 1
    return 100 * float(precision[_RECALL_SLICES[recall_points]].mean())


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
        weights = np.ones(self.frames, np.int64) if frame_weights is None else frame_weights
        return {
            name: compute_curve(matches, weights, has_orientation=self.has_orientation)
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
    detections = [len(one.increments) for one in matches.by_difficulty.values()]
    at_once = max(_CACHED_COUNTS // max([1, *detections]), 1)
    counts: dict[str, list[ThresholdCounts]] = {name: [] for name in matches.by_difficulty}
    weights: list[Int] = []
    for number in progress(range(resamples)):
        drawn = generator.integers(matches.frames, size=matches.frames)
        weights.append(np.bincount(drawn, minlength=matches.frames))
        if len(weights) == at_once or number == resamples - 1:
            for name, statistics in matches.by_difficulty.items():
                counts[name].append(count_at_thresholds(statistics, np.array(weights, np.int64)))
            weights.clear()
    return {
        name: _samples(blocks, has_orientation=matches.has_orientation)
        for name, blocks in counts.items()
    }


def _samples(blocks: Sequence[ThresholdCounts], *, has_orientation: bool) -> PrecisionSamples:
    has_truths = np.concatenate([block.truths > 0 for block in blocks])
    precision = np.concatenate([block.precision for block in blocks])
    similarity = np.concatenate([block.orientation_similarity for block in blocks])
    return PrecisionSamples(
        _averages(precision, has_truths), _averages(similarity, has_truths & has_orientation)
    )


def _averages(curves: Float64, is_known: Bool) -> dict[int, Float64]:
    """Return (N,) averages in percent of (N, 41) curves by number of recall points."""
    means = {points: curves[:, part].mean(axis=1) for points, part in _RECALL_SLICES.items()}
    return {points: np.where(is_known, 100 * one, np.nan) for points, one in means.items()}
