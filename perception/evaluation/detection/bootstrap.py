"""Bootstrap intervals of the average precision over the choice of frames.

B. Efron, "Bootstrap methods: another look at the jackknife", Annals of Statistics 1979: each resample draws as many
frames as there are, with replacement; the interval holds the middle share of the resampled averages.
"""

from dataclasses import dataclass

import numpy as np

from perception.errors import UsageError
from perception.evaluation.detection.average_precision import DetectionStatistics
from perception.evaluation.detection.precision_curve import PrecisionCurve
from perception.types import Float64, Progress


@dataclass(frozen=True)
class Interval:
    """Interval of the average precision in percent; NaN where no resample holds an object."""

    low: float
    high: float


NO_INTERVAL = Interval(np.nan, np.nan)


@dataclass(frozen=True)
class PrecisionSamples:
    """Average precision of one class at one difficulty in N bootstrap resamples.

    Attributes:
        percent: (N,) averages in percent by the number of recall points; NaN of a resample without an object.
    """

    percent: dict[int, Float64]


def percentile_interval(percent: Float64, confidence: float = 0.95) -> Interval:
    """Return the percentile interval of (N,) averages or of their differences."""
    known = percent[~np.isnan(percent)]
    if len(known) == 0:
        return NO_INTERVAL
    low, high = np.quantile(known, [(1 - confidence) / 2, (1 + confidence) / 2])
    return Interval(float(low), float(high))


def resample_precision(
    statistics: DetectionStatistics,
    resamples: int,
    generator: np.random.Generator,
    progress: Progress = iter,
) -> tuple[dict[str, PrecisionSamples], ...]:
    """Return the average precision of bootstrap resamples, the same resamples for all classes and difficulties.

    Args:
        statistics: Matches of all frames.
        resamples: Number of resamples.
        generator: Random generator of the resamples.
        progress: Iterates over the resamples and may show a progress bar.

    Returns:
        Samples of each class by difficulty.

    Raises:
        UsageError: there is no frame or no resample.
    """
    if resamples < 1 or statistics.frames < 1:
        raise UsageError(
            "bootstrap",
            expected="at least one resample of at least one frame",
            found=f"{resamples} resamples of {statistics.frames} frames",
        )
    metrics = []
    for _ in progress(range(resamples)):
        drawn = generator.integers(statistics.frames, size=statistics.frames)
        metrics.append(statistics.metrics(np.bincount(drawn, minlength=statistics.frames)))
    return tuple(
        {name: _samples([one.classes[k].curves[name] for one in metrics]) for name in by_difficulty}
        for k, by_difficulty in enumerate(statistics.statistics)
    )


def _samples(curves: list[PrecisionCurve]) -> PrecisionSamples:
    points: tuple[int, ...] = (11, 40)
    return PrecisionSamples(
        {
            recall_points: np.array([c.ap(recall_points) if c.truths else np.nan for c in curves])
            for recall_points in points
        }
    )
