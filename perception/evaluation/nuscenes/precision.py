"""Average precision of one class over centre distances, and the errors of its true positives."""

from dataclasses import dataclass

import numpy as np

from perception.evaluation.grouping import ranks_in_groups
from perception.evaluation.nuscenes.boxes import TaskBoxes, TaskDetections, TaskObjects
from perception.evaluation.nuscenes.protocol import (
    DISTANCES_M,
    ERROR_DISTANCE_M,
    ERRORS,
    MIN_PRECISION,
    MIN_RECALL,
    RECALL_STEPS,
    TaskClass,
)
from perception.geometry.se3 import wrap
from perception.types import Bool, Float64, Int

_RECALLS = np.linspace(0, 1, RECALL_STEPS + 1)
_FIRST = round(MIN_RECALL * RECALL_STEPS) + 1  # point of a curve that counts
FREE = -1  # number of the object that a detection without one matches


@dataclass(frozen=True)
class ClassCurves:
    """Precision and errors of one class.

    Attributes:
        precision: (4, 101) precision at each distance and at recall 0, 0.01 .. 1.
        errors: (5,) errors of the true positives; NaN of those that the class does not have.
    """

    precision: Float64
    errors: Float64

    @property
    def ap(self) -> Float64:
        """(4,) average precision at each distance, 0 to 1."""
        above = np.maximum(self.precision[:, _FIRST:] - MIN_PRECISION, 0.0)
        return np.asarray(above.mean(axis=1) / (1 - MIN_PRECISION))


def measure_class(
    truths: TaskObjects,
    truth_samples: Int,
    found: TaskDetections,
    found_samples: Int,
    rule: TaskClass,
    is_in_view: Bool,
) -> ClassCurves:
    """Measure the detections of one class.

    Args:
        truths: (G) objects that count, of all samples.
        truth_samples: (G,) number of the sample of each.
        found: (D) detections that count, of all samples.
        found_samples: (D,) number of the sample of each.
        rule: Class.
        is_in_view: (D,) whether each is where all objects are labelled; one that is not and matches none does not count.
    """
    # Of equal scores the last comes first.
    order = np.lexsort((-np.arange(len(found)), -found.scores))
    found, found_samples, is_in_view = found[order], found_samples[order], is_in_view[order]
    matches = match_centers(
        truths.centers_m[:, :2], truth_samples, found.centers_m[:, :2], found_samples
    )
    counts = is_in_view | (matches != FREE)
    precision = [
        precision_over_recall(one[rows] != FREE, len(truths))
        for one, rows in zip(matches, counts, strict=True)
    ]
    level = DISTANCES_M.index(ERROR_DISTANCE_M)
    rows = counts[level]
    errors = _mean_errors(truths, found[rows], matches[level, rows], rule)
    is_measured = np.isin(ERRORS, rule.errors)
    return ClassCurves(np.array(precision), np.where(is_measured, errors, np.nan))


def match_centers(truths_m: Float64, truth_samples: Int, found_m: Float64, samples: Int) -> Int:
    """Return (4, D) the object that each detection matches at each distance, -1 for none.

    Each detection takes the nearest object of its sample that none before it has. All samples go on at once: first the
    best detection of each, then the second.

    Args:
        truths_m: (G, 2) places of the objects.
        truth_samples: (G,) number of the sample of each.
        found_m: (D, 2) places of the detections, best first.
        samples: (D,) number of the sample of each.
    """
    matches = np.full((len(DISTANCES_M), len(found_m)), FREE)
    if not len(truths_m) or not len(found_m):
        return matches
    known, rows = np.unique(truth_samples, return_inverse=True)
    columns = ranks_in_groups(truth_samples)
    table = np.full((len(known), int(columns.max()) + 1), FREE)
    table[rows, columns] = np.arange(len(truths_m))
    is_free = np.broadcast_to(table != FREE, (len(DISTANCES_M), *table.shape)).copy()
    limits_m = np.array(DISTANCES_M)[:, None]
    places = np.minimum(np.searchsorted(known, samples), len(known) - 1)
    ranks = np.where(known[places] == samples, ranks_in_groups(samples), FREE)
    order = np.argsort(ranks, kind="stable")
    starts = np.flatnonzero(np.diff(ranks[order], prepend=ranks[order][0]))
    for turn in np.split(order, starts):
        if ranks[turn[0]] == FREE:
            continue  # samples without an object
        of_sample = table[places[turn]]
        offsets_m = truths_m[of_sample] - found_m[turn, None]
        distances_m = np.hypot(offsets_m[..., 0], offsets_m[..., 1])
        free_m = np.where(is_free[:, places[turn]], distances_m, np.inf)
        nearest = free_m.argmin(axis=2)
        nearest_m = np.take_along_axis(free_m, nearest[..., None], axis=2)[..., 0]
        levels, hits = np.nonzero(nearest_m < limits_m)
        taken = nearest[levels, hits]
        matches[levels, turn[hits]] = of_sample[hits, taken]
        is_free[levels, places[turn[hits]], taken] = False
    return matches


def _recalls(is_hit: Bool, objects: int) -> Float64:
    return np.cumsum(is_hit) / objects


def precision_over_recall(is_hit: Bool, objects: int) -> Float64:
    """Return (101,) precision at recall 0, 0.01 .. 1, 0 beyond the highest, of (D,) detections, best first."""
    if not is_hit.any():
        return np.zeros(len(_RECALLS))
    precision = np.cumsum(is_hit) / np.arange(1, len(is_hit) + 1)
    return np.interp(_RECALLS, _recalls(is_hit, objects), precision, right=0)


def _mean_errors(
    truths: TaskObjects, found: TaskDetections, match: Int, rule: TaskClass
) -> Float64:
    """Return (5,) means over the recalls that are reached, of the cumulative means of the errors; 1 below recall 0.1."""
    is_hit = match != FREE
    if not is_hit.any():
        return np.ones(len(ERRORS))
    recalls = _recalls(is_hit, len(truths))
    scores = np.interp(_RECALLS, recalls, found.scores, right=0)
    last = int(np.flatnonzero(scores)[-1]) if scores.any() else 0
    if last < _FIRST:
        return np.ones(len(ERRORS))
    hits = found[is_hit]
    errors = _errors(truths[match[is_hit]], hits, rule)
    means = [
        np.interp(scores[::-1], hits.scores[::-1], _cumulative_mean(one)[::-1])[::-1]
        for one in errors
    ]
    return np.array([mean[_FIRST : last + 1].mean() for mean in means])


def _errors(truths: TaskBoxes, found: TaskBoxes, rule: TaskClass) -> Float64:
    """Return (5, M) errors of matched pairs; NaN where the label states neither velocity nor attribute."""
    offsets_m = found.centers_m - truths.centers_m
    common_m3 = np.minimum(truths.size_m, found.size_m).prod(axis=1)
    joined_m3 = truths.size_m.prod(axis=1) + found.size_m.prod(axis=1) - common_m3
    velocity_m_s = found.velocities_m_s - truths.velocities_m_s
    is_wrong = (truths.attributes != found.attributes).astype(np.float64)
    return np.stack(
        [
            np.hypot(offsets_m[:, 0], offsets_m[:, 1]),
            1 - common_m3 / joined_m3,
            np.abs(wrap(found.yaw_rad - truths.yaw_rad, rule.heading_period_rad)),
            np.hypot(velocity_m_s[:, 0], velocity_m_s[:, 1]),
            np.where(truths.attributes == "", np.nan, is_wrong),
        ]
    )


def _cumulative_mean(values: Float64) -> Float64:
    """Return (M,) means of the values so far that are known: 0 before the first, 1 where none is."""
    is_known = ~np.isnan(values)
    if not is_known.any():
        return np.ones(len(values))
    return np.asarray(np.nancumsum(values) / np.maximum(np.cumsum(is_known), 1))
