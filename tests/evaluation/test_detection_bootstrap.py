"""Bootstrap intervals of the average precision."""

from dataclasses import replace

import numpy as np
import pytest

from perception.evaluation.detection.average_precision import (
    ClassMatches,
    match_detections,
    percentile_interval,
    resample_precision,
)
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.evaluation_boxes import pair_boxes


def noisy_matches(frames: int, cyclist_frames: int = 1) -> list[ClassMatches]:
    """Return frames of two cars, of which three in four are found, and every other frame has a ghost."""
    rng = np.random.default_rng(7)
    numbers = np.repeat(np.arange(frames), 2)
    x = np.tile([0.0, 300.0], frames)
    boxes = np.column_stack([x, np.zeros(2 * frames), x + 100, np.full(2 * frames, 60.0)])
    is_cyclist = (numbers < cyclist_frames) & (x > 0)
    types = np.where(is_cyclist, "Cyclist", "Car")
    nothing = np.zeros(2 * frames)
    truths = TrueBoxes(numbers, types, nothing, boxes, truncation=nothing, occlusion=nothing)
    is_found = rng.random(2 * frames) < 0.75
    is_ghost = (numbers % 2 == 0) & (x > 0)
    kept = np.sort(np.concatenate([np.flatnonzero(is_found), np.flatnonzero(is_ghost)]))
    again = np.append(False, np.diff(kept) == 0)
    shifted = boxes[kept] + np.where(again | ~is_found[kept], 500, 0)[:, None]
    scores = rng.normal(size=len(kept)) - again
    detections = DetectedBoxes(numbers[kept], types[kept], nothing[kept], shifted, scores)
    return list(match_detections(pair_boxes(truths, detections, frames)).values())


def test_the_same_generator_gives_the_same_interval():
    car, _, _ = noisy_matches(60)
    first, again, other = (
        resample_precision(car, 20, np.random.default_rng(seed))["easy"] for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first.ap[40], again.ap[40])
    assert percentile_interval(first.ap[40]) == percentile_interval(again.ap[40])
    assert percentile_interval(first.ap[40]) != percentile_interval(other.ap[40])


@pytest.mark.parametrize("points", [11, 40])
def test_the_interval_holds_the_figure_and_narrows_with_more_frames(points):
    widths = []
    for frames in (60, 600):
        car, _, _ = noisy_matches(frames)
        metric = car.curves()["moderate"].ap(points)
        samples = resample_precision(car, 100, np.random.default_rng(0))["moderate"]
        interval = percentile_interval(samples.ap[points])
        assert interval.low < metric < interval.high
        narrow = percentile_interval(samples.ap[points], confidence=0.5)
        assert interval.low < narrow.low < narrow.high < interval.high
        widths.append(interval.high - interval.low)
    assert 0 < widths[1] < 0.6 * widths[0]


def test_orientation_has_an_interval_of_its_own():
    car, _, _ = noisy_matches(60)
    samples = resample_precision(car, 20, np.random.default_rng(0))["easy"]
    # Every heading is right: a true positive counts whole.
    np.testing.assert_array_equal(samples.aos[40], samples.ap[40])
    headless = replace(car, has_orientation=False)
    samples = resample_precision(headless, 20, np.random.default_rng(0))["easy"]
    assert np.isnan(samples.aos[40]).all()


def test_resamples_without_an_object_are_unknown():
    car, pedestrian, cyclist = (
        resample_precision(one, 40, np.random.default_rng(0)) for one in noisy_matches(30)
    )
    assert pedestrian == {}
    is_nothing = np.isnan(cyclist["easy"].ap[40])
    # One frame in 30 holds the cyclist: (1 - 1/30)^30, a third of all resamples, lack it.
    assert 5 < is_nothing.sum() < 25
    assert not np.isnan(car["easy"].ap[40]).any()
    _, _, never = noisy_matches(30, cyclist_frames=0)
    assert resample_precision(never, 4, np.random.default_rng(0)) == {}


def test_resamples_are_curves_of_weighted_frames():
    for of_class in noisy_matches(60):
        samples = resample_precision(of_class, 120, np.random.default_rng(3))
        rng, expected = np.random.default_rng(3), {name: [] for name in samples}
        for _ in range(120):
            curves = of_class.curves(np.bincount(rng.integers(60, size=60), minlength=60))
            for name, curve in curves.items():
                expected[name].append((curve.truths, curve.ap(), curve.aos(), curve.ap(11)))
        for name, rows in expected.items():
            truths, ap, aos, ap_11 = np.array(rows).T
            found = samples[name]
            for one, values in ((found.ap[40], ap), (found.aos[40], aos), (found.ap[11], ap_11)):
                np.testing.assert_allclose(one, np.where(truths > 0, values, np.nan), atol=1e-9)


def test_progress_sees_every_resample():
    seen = []

    def watch(numbers):
        for number in numbers:
            seen.append(number)
            yield number

    resample_precision(noisy_matches(10)[0], 5, np.random.default_rng(0), watch)
    assert seen == [0, 1, 2, 3, 4]
