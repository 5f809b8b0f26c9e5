"""Detectors of three modalities as their faults would have them: misses, loose boxes, false alarms.

The camera's sees far and is fooled by pictures of cars: its false alarms have no car's size at their distance.
The maps' see near things better, and are fooled by the same bushes now and then.
"""

from dataclasses import dataclass

import numpy as np

from data.detections.detected_frames import DetectedFrames
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.suppression import suppress
from perception.evaluation.detection.average_precision import kitti_average_precision
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from perception.evaluation.detection.protocol import KITTI_CLASSES
from perception.types import Detections

SIZE_PX = (1242, 375)
_FOCAL_PX, _HEIGHT_M, _CAMERA_M = 721.0, 1.5, 1.65


@dataclass(frozen=True)
class Quality:
    """Of one detector.

    far_m: where half of what it sees at best is missed; jitter: of a box's edges, in shares of its size;
    alarms: a frame; noise: of its scores, as logits.
    """

    far_m: float
    jitter: float
    alarms: float
    noise: float


QUALITIES = {
    "rgb": Quality(70.0, 0.045, 4.0, 1.2),
    "dm": Quality(45.0, 0.050, 3.0, 1.2),
    "rm": Quality(42.0, 0.060, 4.0, 1.4),
}


def simulated_frames(count: int, seed: int) -> DetectedFrames:
    """Return frames that these detectors looked at, and what is true."""
    rng = np.random.default_rng([seed, 77])
    scenes, boxes, frames = [], [], []
    for frame in range(count):
        distances_m = rng.uniform(8, 65, rng.integers(2, 9))
        true_px = _boxes_at(distances_m, _HEIGHT_M * np.ones_like(distances_m), rng)
        bush_m = rng.uniform(8, 50, 2)
        bush_px = _boxes_at(bush_m, rng.uniform(0.7, 2.5, 2), rng)
        modality_detections = {}
        for name, quality in QUALITIES.items():
            found_px, scores = _detected(quality, true_px, distances_m, rng)
            alarm_px, alarm_scores = _alarms(name, quality, bush_px, rng)
            both_px = np.vstack([found_px, alarm_px])
            seen = Detections(
                both_px, np.concatenate([scores, alarm_scores]), np.full(len(both_px), "Car")
            )
            kept = suppress(seen, 0.5)
            modality_detections[name] = seen[kept]
        scenes.append(DetectedScene(modality_detections, SIZE_PX))
        boxes.append(true_px)
        frames.append(np.full(len(true_px), frame))
    rows = np.concatenate(frames)
    zeros = np.zeros(len(rows))
    truth = TrueBoxes(
        rows, np.full(len(rows), "Car"), zeros - 10, np.concatenate(boxes), zeros, zeros
    )
    return DetectedFrames(tuple(scenes), truth)


def precision(frames: DetectedFrames, detections: DetectedBoxes, iou: float = 0.7) -> float:
    """Return the average precision in percent, at KITTI's moderate level."""
    of_class = KITTI_CLASSES[0].at_iou(iou)
    figures = kitti_average_precision(
        pair_boxes(frames.truth, detections, len(frames)), (of_class,)
    )
    return figures[of_class]["moderate"].ap()


def _boxes_at(distances_m, heights_m, rng):
    heights_px = _FOCAL_PX * heights_m / distances_m
    widths_px = heights_px * rng.uniform(1.1, 2.4, len(distances_m))
    bottoms_px = 172 + _FOCAL_PX * _CAMERA_M / distances_m
    middles_px = rng.uniform(60, SIZE_PX[0] - 60, len(distances_m))
    return np.stack(
        [
            middles_px - widths_px / 2,
            bottoms_px - heights_px,
            middles_px + widths_px / 2,
            bottoms_px,
        ],
        axis=1,
    )


def _detected(quality, true_px, distances_m, rng):
    visible = 2.5 * (1 - distances_m / quality.far_m) + rng.normal(0, quality.noise, len(true_px))
    is_found = visible > -1.5
    sizes = np.tile(true_px[:, 2:] - true_px[:, :2], 2)
    jitter = (
        quality.jitter * rng.normal(0, 1, true_px.shape) * rng.uniform(0.3, 1.5, (len(true_px), 1))
    )
    boxes_px = true_px + jitter * sizes
    return boxes_px[is_found], _sigmoid(visible[is_found])


def _alarms(name, quality, bush_px, rng):
    count = rng.poisson(quality.alarms)
    distances_m = rng.uniform(8, 65, count)
    heights_m = rng.uniform(0.4, 4.0, count) if name == "rgb" else rng.uniform(0.8, 2.2, count)
    boxes_px = _boxes_at(distances_m, heights_m, rng)
    scores = _sigmoid(rng.normal(-1.0, 1.2, count))
    if name == "rgb":
        return boxes_px, scores
    is_fooled = rng.uniform(size=len(bush_px)) < 0.6
    bush_scores = _sigmoid(rng.normal(0.0, 1.0, int(is_fooled.sum())))
    return (
        np.vstack([boxes_px, bush_px[is_fooled]]),
        np.concatenate([scores, bush_scores]),
    )


def _sigmoid(logits):
    return 1 / (1 + np.exp(-logits))
