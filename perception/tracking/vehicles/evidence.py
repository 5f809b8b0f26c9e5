"""Evidence that tracks are objects, and of which class: sums of log-odds over frames."""

import numpy as np
from numpy.typing import NDArray

from perception.tracking.vehicles.class_sizes import SizePriors
from perception.tracking.vehicles.image_heights import top_deviations
from perception.types import Detections, Float64, Int

_MIN_HEIGHT_DEVIATION_M = 0.15  # of a class, against which the height in the image is evidence
_MAX_HEIGHT_EVIDENCE = 3.0  # maximum evidence that a height takes away
# Beyond these, a single detection would settle a track for good.
_MIN_PROBABILITY = 0.02
_LOWEST_VEHICLE = "Car"
# Time constant of the memory of evidence, since detections of one object err alike, and the evidence of an object that is
# always detected, in that of one detection.
_MEMORY_S, _MAX_EVIDENCE_RATIO = 0.615, 6.67
MISS = -0.1  # log-odds of a scan without a detection


def with_heights(existence: Float64, heights_m: Float64, detections: Detections) -> Float64:
    """Return (D,) the probability of existence of detections, given their heights.

    A bicycle without a rider and a post are too low for people, a motorcycle and a bush too low for a vehicle, of
    which cars are the lowest.

    Args:
        existence: (D,) probabilities of existence by the scores.
        heights_m: (D,) heights that the image shows; NaN where they are not known.
        detections: (D) detections in the image.
    """
    has_sides = SizePriors.of(detections.types).has_sides
    lowest = SizePriors.of(np.where(has_sides, _LOWEST_VEHICLE, detections.types))
    mean_m, deviation_m = lowest.height_m.T
    deviation_m = np.maximum(deviation_m, _MIN_HEIGHT_DEVIATION_M)
    variance_m2 = deviation_m**2 + (top_deviations(detections.boxes_px) * mean_m) ** 2
    off_m = heights_m - mean_m
    off_m = np.where(has_sides, np.minimum(off_m, 0.0), off_m)
    against = np.minimum(np.nan_to_num(off_m) ** 2 / variance_m2 / 2, _MAX_HEIGHT_EVIDENCE)
    return probability(log_odds(existence) - against)


def remembered(elapsed_s: float, memory_s: float = _MEMORY_S) -> float:
    """Return the share of the evidence that is left after a time."""
    return float(np.exp(-elapsed_s / memory_s))


def added(log_odds: Float64 | float, elapsed_s: float, memory_s: float = _MEMORY_S) -> Float64:
    """Return the evidence that log-odds of a scan add, for the time since the scan before.

    With the memory, evidence is the mean of the log-odds over time, whatever the rate of the scans.
    """
    share = 1.0 - remembered(elapsed_s, memory_s)
    return np.asarray(_MAX_EVIDENCE_RATIO * share * log_odds)


def probability(evidence: Float64) -> Float64:
    """Return the probability of evidence."""
    return np.asarray(1.0 / (1.0 + np.exp(-evidence)))


def likeliest_classes(
    evidence: Float64,
    heights_m: Float64,
    classes: NDArray[np.str_],
    height_deviation_m: float,
    score_weight: float,
) -> Int:
    """Return (T,) the number of the likeliest class of each track.

    Detectors tell vehicles from people, and these from each other. The image of a van deceives them, its height does
    not: it decides between vehicles, whose scores all err alike.

    Args:
        evidence: (T, C) sums of the scores of each class.
        heights_m: (T,) heights of the boxes; NaN where they are not observed.
        classes: (C,) names of the classes.
        height_deviation_m: Standard deviation of these heights.
        score_weight: Weight of the logarithm of scores beside that of the likelihood of a height.
    """
    sizes = SizePriors.of(classes)
    mean_m, deviation_m = sizes.height_m.T
    variance_m2 = deviation_m**2 + height_deviation_m**2
    squared_m2 = (heights_m[:, None] - mean_m) ** 2
    by_height = -(squared_m2 / variance_m2 + np.log(variance_m2)) / 2
    shares = evidence / np.maximum(evidence.sum(axis=1, keepdims=True), _MIN_PROBABILITY)
    by_score = np.log(np.maximum(shares, _MIN_PROBABILITY))
    is_told_by_height = sizes.has_sides & np.isfinite(heights_m)[:, None]
    is_alike = sizes.has_sides == sizes.has_sides[evidence.argmax(axis=1)][:, None]
    likelihoods = np.where(is_told_by_height, score_weight * by_score + by_height, by_score)
    return np.asarray(np.where(is_alike, likelihoods, -np.inf).argmax(axis=1))


def log_odds(probabilities: Float64, least: float = _MIN_PROBABILITY) -> Float64:
    """Return the evidence of probabilities; 0 of even chances.

    Args:
        probabilities: Probabilities; those nearer to 0 or 1 than the least count as that.
        least: Smallest probability.
    """
    inside = np.clip(probabilities, least, 1.0 - least)
    return np.asarray(np.log(inside / (1.0 - inside)))
