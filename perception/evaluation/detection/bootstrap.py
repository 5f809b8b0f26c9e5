"""Bootstrap intervals of the average precision over the choice of frames.

B. Efron, "Bootstrap methods: another look at the jackknife", Annals of Statistics 1979: each resample draws as many
frames as there are, with replacement; the interval holds the middle share of the resampled averages.
"""

from dataclasses import dataclass

import numpy as np

from perception.errors import UsageError
from perception.evaluation.detection.average_precision import ClassMatches
from perception.evaluation.detection.config import RECALL_POINTS
from perception.types import Float64, Progress


@dataclass(frozen=True)
class Interval:
    """Interval of the average precision in percent; NaN where no resample holds an object."""

    low: float
    high: float


NO_INTERVAL = Interval(np.nan, np.nan)


# (N,) average precision in percent of N resamples, by number of recall points; NaN of one without an object.
PrecisionSamples = dict[int, Float64]


def percentile_interval(percent: Float64, confidence: float = 0.95) -> Interval:
    """Return the percentile interval of (N,) averages or of their differences."""
    known = percent[~np.isnan(percent)]
    if len(known) == 0:
        return NO_INTERVAL
    low, high = np.quantile(known, [(1 - confidence) / 2, (1 + confidence) / 2])
    return Interval(float(low), float(high))


def resample_precision(
    matches: ClassMatches,
    resamples: int,
    generator: np.random.Generator,
    progress: Progress = iter,
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
    return {
        name: {
            points: np.array([c[name].ap(points) if c[name].truths else np.nan for c in curves])
            for points in RECALL_POINTS
        }
        for name in matches.by_difficulty
    }
