"""KITTI's average precisions beside their reference implementation, on simulated detections of cars."""

from typing import Any

import numpy as np

from benchmarks.measure import Comparison, Contender, Measurement, compare
from benchmarks.reference.detection_ap import reference_curve
from perception.evaluation.detection.average_precision import kitti_average_precision
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from perception.evaluation.detection.overlap_metric import BEV, IMAGE, SPACE, OverlapMetric
from perception.evaluation.detection.protocol import DIFFICULTIES, KITTI_CLASSES, NO_ALPHA_RAD
from perception.evaluation.report import Column
from perception.types import Boxes3D, Float64

CAR = KITTI_CLASSES[0]
_SETS, _FRAMES = 3, 100
# As many a frame as in KITTI's object benchmark: about five cars, and detections of any score.
_TRUTHS, _DETECTIONS = 5, 9
_IMAGE_PX = (1242, 375)
_METRICS: tuple[OverlapMetric[Any], ...] = (IMAGE, BEV, SPACE)


def compare_average_precision() -> Comparison:
    """Measure sets of 100 frames in the image, from above and in space, once for all thresholds and once at each."""
    sets = [random_boxes(_FRAMES, np.random.default_rng(seed)) for seed in range(_SETS)]

    def at_once(i: int) -> Float64:
        paired = (pair_boxes(*sets[i], _FRAMES, metric) for metric in _METRICS)
        curves = [kitti_average_precision(boxes, (CAR,))[CAR] for boxes in paired]
        return np.array([[curve.precision for curve in one.values()] for one in curves])

    def reference(i: int) -> Float64:
        curves = [
            [reference_curve(*sets[i], _FRAMES, CAR, one, metric) for one in DIFFICULTIES]
            for metric in _METRICS
        ]
        return np.array([[curve.precision for curve in one] for one in curves])

    expected = [at_once(i) for i in range(_SETS)]

    def largest_difference(row: Measurement) -> float:
        return float(np.abs(np.array(row.outputs) - expected).max())

    return compare(
        f"average precision, {_FRAMES} frames",
        [
            Contender("Trifuse", at_once),
            Contender("reference: every frame at every threshold", reference),
        ],
        _SETS,
        Column("largest difference", largest_difference, ".0e", "largest_difference"),
    )


def random_boxes(frames: int, generator: np.random.Generator) -> tuple[TrueBoxes, DetectedBoxes]:
    """Return labelled cars, vans and DontCare regions, and detections: most of them near a label."""
    count = frames * _TRUTHS
    height = generator.uniform(15, 150, count)
    size = np.stack([height * generator.uniform(1.0, 2.5, count), height], axis=1)
    corner = generator.uniform(0, _IMAGE_PX, (count, 2)) - size / 2
    truths = TrueBoxes(
        frames=np.repeat(np.arange(frames), _TRUTHS),
        types=generator.choice(["Car", "Van", "DontCare"], count, p=[0.8, 0.1, 0.1]),
        alphas_rad=np.full(count, NO_ALPHA_RAD),
        boxes_px=np.concatenate([corner, corner + size], axis=1),
        truncation=generator.choice([0.0, 0.2, 0.6], count, p=[0.8, 0.1, 0.1]),
        occlusion=generator.choice([0.0, 1.0, 2.0], count, p=[0.6, 0.25, 0.15]),
        boxes_3d=Boxes3D(
            generator.uniform([5, -20, -1.7], [60, 20, -1.6], (count, 3)),
            generator.uniform([3.4, 1.5, 1.4], [4.8, 1.9, 1.8], (count, 3)),
            generator.uniform(-np.pi, np.pi, count),
        ),
    )
    total = frames * _DETECTIONS
    near = np.repeat(np.arange(frames), _DETECTIONS) * _TRUTHS + generator.integers(
        _TRUTHS, size=total
    )
    # Some lie well, some beside, and the worse they lie the lower is their score.
    shift = np.abs(generator.normal(0, 0.12, total))
    turn = generator.uniform(0, 2 * np.pi, total)
    moved = shift[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1) * size[near]
    boxes = truths.boxes_3d[near]
    moved_m = shift[:, None] * generator.normal(0, [3.0, 1.5, 0.3], (total, 3))
    detections = DetectedBoxes(
        frames=np.repeat(np.arange(frames), _DETECTIONS),
        types=np.full(total, "Car"),
        alphas_rad=np.full(total, NO_ALPHA_RAD),
        boxes_px=truths.boxes_px[near] + np.tile(moved, 2),
        scores=np.exp(-4 * shift) * generator.uniform(0.7, 1.0, total),
        boxes_3d=Boxes3D(boxes.bottom_m + moved_m, boxes.size_m, boxes.yaw_rad + shift),
    )
    return truths, detections
