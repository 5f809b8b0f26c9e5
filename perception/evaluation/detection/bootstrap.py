"""How far the averages would have differed on other frames of the same kind.

B. Efron, "Bootstrap methods: another look at the jackknife", Annals of Statistics 1979: frames are drawn
with replacement, as many as there are, again and again; the interval holds the middle share of the averages.
"""

from dataclasses import dataclass

import numpy as np

from perception.errors import UsageError
from perception.evaluation.detection.average_precision import DetectionStatistics
from perception.evaluation.detection.precision_curve import PrecisionCurve
from perception.types import Float64, Progress


@dataclass(frozen=True)
class Interval:
    """Between two averages, in percent; NaN where no choice of frames holds an object."""

    low: float
    high: float


@dataclass(frozen=True)
class PrecisionSamples:
    """Average precision of one class at one difficulty on N choices of frames.

    Attributes:
        percent: by recall points, (N,) averages; NaN for a choice of frames without an object.
    """

    percent: dict[int, Float64]

    def interval(self, recall_points: int = 40, confidence: float = 0.95) -> Interval:
        """Return the percentiles between which the given share of the averages lies."""
        return percentile_interval(self.percent[recall_points], confidence)


def percentile_interval(percent: Float64, confidence: float = 0.95) -> Interval:
    """Return the percentiles between which the given share of (N,) averages, or of their differences, lies."""
    known = percent[~np.isnan(percent)]
    if len(known) == 0:
        return Interval(np.nan, np.nan)
    low, high = np.quantile(known, [(1 - confidence) / 2, (1 + confidence) / 2])
    return Interval(float(low), float(high))


def resample_precision(
    statistics: DetectionStatistics,
    resamples: int,
    generator: np.random.Generator,
    progress: Progress = iter,
) -> tuple[dict[str, PrecisionSamples], ...]:
    """Measure choices of frames, each the same for all classes and difficulties.

    Args:
        statistics: of all frames.
        resamples: how many choices.
        generator: draws them.
        progress: goes through the numbers of the choices, and may show how far it is.

    Returns:
        For each class, by name of the difficulty.

    Raises:
        UsageError: no frame to draw from, or no choice asked for.
    """
    if resamples < 1 or statistics.frames < 1:
        raise UsageError(
            "bootstrap",
            expected="at least one choice of at least one frame",
            found=f"{resamples} choices of {statistics.frames} frames",
        )
    metrics = []
    for _ in progress(range(resamples)):
        drawn = generator.integers(statistics.frames, size=statistics.frames)
        metrics.append(statistics.metrics(np.bincount(drawn, minlength=statistics.frames)))
    return tuple(
        {name: _samples([one.classes[k].curves[name] for one in metrics]) for name in of_class}
        for k, of_class in enumerate(statistics.statistics)
    )


def _samples(curves: list[PrecisionCurve]) -> PrecisionSamples:
    points: tuple[int, ...] = (11, 40)
    return PrecisionSamples(
        {
            recall_points: np.array([c.ap(recall_points) if c.truths else np.nan for c in curves])
            for recall_points in points
        }
    )
