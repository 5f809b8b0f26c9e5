"""Each group of rivals matched once says the same as every frame matched at every threshold."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.reference.detection_ap import reference_curve, reference_thresholds
from perception.evaluation.detection import match_statistics
from perception.evaluation.detection.average_precision import (
    PrecisionCurve,
    kitti_average_precision,
    match_detections,
)
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes, unknown_boxes
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from perception.evaluation.detection.overlap_metric import BEV, SPACE, OverlapMetric
from perception.evaluation.detection.protocol import DIFFICULTIES, KITTI_CLASSES
from perception.evaluation.detection.threshold_counts import threshold_ranks
from perception.types import Boxes3D

FRAMES = 12
TYPES = np.array(
    ["Car", "car", "CAR", "Van", "Pedestrian", "Person_sitting", "Cyclist", "DontCare"]
)


def crowded_frames(seed: int) -> tuple[TrueBoxes, DetectedBoxes]:
    """Return boxes that overlap in many ways: rivals, equal scores, low ones, empty ones, DontCare."""
    rng = np.random.default_rng(seed)
    truth_frames = np.sort(rng.integers(FRAMES, size=140))
    boxes = boxes_around(rng, np.array([60, 60, 140, 110]), len(truth_frames), spread_px=40)
    truths = TrueBoxes(
        frames=truth_frames,
        types=rng.choice(TYPES, len(truth_frames)),
        alphas_rad=rng.uniform(-3, 3, len(truth_frames)),
        boxes_px=boxes,
        truncation=rng.choice([0, 0, 0, 0.2, 0.3, 0.6], len(truth_frames)),
        occlusion=rng.choice([0.0, 0.0, 1.0, 2.0, 3.0], len(truth_frames)),
    )
    near = rng.integers(len(truths), size=360)
    near = near[np.argsort(truth_frames[near], kind="stable")]
    detections = DetectedBoxes(
        frames=truth_frames[near],
        types=np.where(
            rng.random(len(near)) < 0.8, truths.types[near], rng.choice(TYPES, len(near))
        ),
        alphas_rad=rng.uniform(-3, 3, len(near)),
        boxes_px=boxes_around(rng, boxes[near], len(near), spread_px=12),
        scores=np.round(rng.normal(size=len(near)), 1),
    )
    return truths, detections


def crowded_road(seed: int) -> tuple[TrueBoxes, DetectedBoxes]:
    """Return the same frames with 3D boxes that overlap in many ways, some of them unknown."""
    truths, detections = crowded_frames(seed)
    rng = np.random.default_rng(seed)
    place = np.concatenate([rng.uniform(-4, 4, (len(truths), 2)), np.zeros((len(truths), 1))], 1)
    size = rng.uniform([3, 1.4, 1.4], [5, 2, 2], (len(truths), 3))
    yaw = rng.uniform(-4, 4, len(truths))
    # Each detection was made of a label of its frame, in this order.
    first = np.searchsorted(truths.frames, detections.frames)
    of_frame = np.bincount(truths.frames, minlength=FRAMES)[detections.frames]
    near = first + rng.integers(of_frame)
    found = Boxes3D(
        place[near] + rng.normal(0, 0.15, (len(near), 3)),
        size[near] * rng.uniform(0.9, 1.1, (len(near), 3)),
        yaw[near] + rng.normal(0, 0.1, len(near)) + rng.choice([0, np.pi], len(near)),
    )
    is_unknown = np.flatnonzero(rng.random(len(near)) < 0.1)
    return (
        replace(truths, boxes_3d=Boxes3D(place, size, yaw)),
        replace(detections, boxes_3d=found.replaced(is_unknown, unknown_boxes(len(is_unknown)))),
    )


def boxes_around(
    rng: np.random.Generator, middle: np.ndarray, count: int, spread_px: float
) -> np.ndarray:
    boxes = np.round(middle + rng.uniform(-spread_px, spread_px, (count, 4)))
    return np.concatenate([np.minimum(boxes[:, :2], boxes[:, 2:]), boxes[:, 2:]], axis=1)


def assert_same(curve: PrecisionCurve, naive: PrecisionCurve) -> None:
    assert (curve.truths, curve.matches) == (naive.truths, naive.matches)
    for name in ("thresholds", "true_positives", "false_positives", "false_negatives"):
        np.testing.assert_array_equal(getattr(curve, name), getattr(naive, name))
    np.testing.assert_allclose(curve.precision, naive.precision, atol=1e-12)
    if naive.orientation_similarity is not None:
        np.testing.assert_allclose(
            curve.orientation_similarity, naive.orientation_similarity, atol=1e-12
        )


@pytest.mark.parametrize("iou", [0.0, 0.2, 0.5, 0.7, 0.9])
@pytest.mark.parametrize("seed", range(3))
def test_any_overlap_gives_the_counts_of_the_reference(seed: int, iou: float):
    truths, detections = crowded_frames(seed)
    classes = [of_class.at_iou(iou) for of_class in KITTI_CLASSES]
    metrics = kitti_average_precision(pair_boxes(truths, detections, FRAMES), classes)
    for of_class, curves in metrics.items():
        for difficulty in DIFFICULTIES:
            naive = reference_curve(truths, detections, FRAMES, of_class, difficulty)
            assert_same(curves[difficulty.name], naive)
    assert metrics[classes[0]]["hard"].matches > 5 or iou > 0.8


@pytest.mark.parametrize("metric", [BEV, SPACE], ids=["bev", "3d"])
@pytest.mark.parametrize("iou", [0.25, 0.5, 0.7])
def test_any_overlap_of_3d_boxes_gives_the_counts_of_the_reference(
    metric: OverlapMetric, iou: float
):
    truths, detections = crowded_road(5)
    classes = [of_class.at_iou(iou) for of_class in KITTI_CLASSES]
    metrics = kitti_average_precision(pair_boxes(truths, detections, FRAMES, metric), classes)
    for of_class, curves in metrics.items():
        for difficulty in DIFFICULTIES:
            naive = reference_curve(truths, detections, FRAMES, of_class, difficulty, metric)
            same = replace(naive, orientation_similarity=None)
            assert curves[difficulty.name].orientation_similarity is None
            assert_same(curves[difficulty.name], same)
    assert metrics[classes[0]]["hard"].matches > 3


def test_frames_that_weigh_double_are_frames_that_are_there_twice():
    truths, detections = crowded_frames(3)
    weights = np.random.default_rng(0).integers(0, 3, FRAMES)
    car, hard = KITTI_CLASSES[0].at_iou(0.4), DIFFICULTIES[2]
    statistics = match_detections(pair_boxes(truths, detections, FRAMES), [car], [hard])
    frames = np.repeat(np.arange(FRAMES), weights)
    naive = reference_curve(
        take_frames(truths, frames), take_frames(detections, frames), len(frames), car, hard
    )
    assert naive.matches > 10
    assert_same(statistics[car].curves(weights)["hard"], naive)


def take_frames(rows, frames):
    """Return the rows of the frames in turn, numbered anew."""
    taken = [np.flatnonzero(rows.frames == frame) for frame in frames]
    numbers = np.repeat(np.arange(len(frames)), [len(part) for part in taken])
    chosen = rows[np.concatenate(taken)]
    return type(rows)(**{**vars(chosen), "frames": numbers})


def test_many_small_blocks_count_as_one_large(monkeypatch: pytest.MonkeyPatch):
    truths, detections = crowded_frames(4)
    car = KITTI_CLASSES[0].at_iou(0.2)
    whole = kitti_average_precision(pair_boxes(truths, detections, FRAMES), [car])[car]
    monkeypatch.setattr(match_statistics, "MAX_BLOCK_PAIRS", 7)
    blocks = kitti_average_precision(pair_boxes(truths, detections, FRAMES), [car])[car]
    for name, curve in whole.items():
        same = blocks[name]
        np.testing.assert_array_equal(curve.false_positives, same.false_positives)
        np.testing.assert_array_equal(curve.orientation_similarity, same.orientation_similarity)


@pytest.mark.parametrize("truths", [*range(1, 130), 400, 402, 1000, 5644, 11288])
def test_thresholds_are_those_of_walking_down_the_scores(truths: int):
    for matches in {1, truths // 3, truths // 2, int(truths * 0.85), truths - 1, truths} - {0}:
        scores = np.arange(matches, 0, -1.0)
        walked = reference_thresholds(scores.tolist(), truths)
        assert scores[threshold_ranks(matches, truths) - 1].tolist() == walked


def test_no_true_positive_gives_no_threshold():
    assert len(threshold_ranks(0, 12)) == 0
    assert len(threshold_ranks(0, 0)) == 0
