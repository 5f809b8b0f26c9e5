"""Augmentation of the fusion's frames: dropped modalities and jittered scores.

On roads that they were not trained on, the scores of detectors are miscalibrated by different amounts. Trained on
jittered scores, the fusion relies more on agreement and on the depth of the boxes.
"""

from dataclasses import replace

import numpy as np

from data.detections.detected_frames import DetectedFrames
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.score_calibration import BetaCalibration
from perception.types import Modality

# Modalities that are dropped; with a single one left there is nothing to fuse.
DROPPED_MODALITIES: tuple[tuple[Modality, ...], ...] = (("rgb",), ("dm",), ("rm",))
# Largest stretch of the scores' logits, and standard deviation of their shift, for each frame and modality.
_MAX_STRETCH, _SHIFT = 0.15, 0.45


def jitter_scores(frames: DetectedFrames, seed: int) -> DetectedFrames:
    """Return the same boxes with scores that other detectors might have given them, in the same order."""
    rng = np.random.default_rng(seed)
    return replace(frames, scenes=tuple(_jitter_scene(scene, rng) for scene in frames.scenes))


def _jitter_scene(scene: DetectedScene, rng: np.random.Generator) -> DetectedScene:
    modality_detections = {}
    for name, found in scene.modality_detections.items():
        stretch = 1 + _MAX_STRETCH * rng.uniform(-1, 1)
        other = BetaCalibration(stretch, stretch, _SHIFT * rng.standard_normal())
        modality_detections[name] = replace(found, scores=other.probabilities(found.scores))
    return replace(scene, modality_detections=modality_detections)
