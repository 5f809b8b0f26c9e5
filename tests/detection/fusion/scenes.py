"""Scenes of boxes at random places, in clumps, so that sets of all sizes come about."""

import numpy as np

from perception.detection.fusion.detected_scene import DetectedScene
from perception.types import MODALITIES, Detections

SIZE_PX = (1242, 375)


def detections(boxes_px, scores=None, type_="Car") -> Detections:
    boxes_px = np.asarray(boxes_px, float).reshape(-1, 4)
    scores = np.linspace(0.9, 0.1, len(boxes_px)) if scores is None else np.asarray(scores, float)
    return Detections(boxes_px, scores, np.full(len(boxes_px), type_))


def clumped_scene(seed: int, clumps: int = 5, most: int = 3) -> DetectedScene:
    rng = np.random.default_rng(seed)
    centers = rng.uniform((100, 100), (1100, 300), (clumps, 2))
    modality_detections = {}
    for modality in MODALITIES:
        counts = rng.integers(0, most + 1, clumps)
        middles = np.repeat(centers, counts, axis=0) + rng.normal(0, 12, (counts.sum(), 2))
        sizes = rng.uniform((60, 40), (140, 90), (len(middles), 2))
        boxes_px = np.hstack([middles - sizes / 2, middles + sizes / 2])
        modality_detections[modality] = detections(boxes_px, rng.uniform(0, 1, len(boxes_px)))
    return DetectedScene(modality_detections, SIZE_PX)
