"""Which sources see: how often each has found, in the last seconds, what others hold for an object.

A source is the detector of one modality in the image of one camera. One that works finds most objects; a blind one, behind
dirt or of a sensor unlike those that its network knows, as many as chance would. What both make likely is added up:

    log-odds that it works = prior + sum of log likelihoods of what it has found and missed, which fades
"""

from collections.abc import Sequence

import numpy as np

from perception.detection.fusion.detected_scene import DetectedScene
from perception.geometry.box_overlap_px import iou_px
from perception.tracking.vehicles.evidence import added, probability, remembered
from perception.types import MODALITIES, Bool, Float64, Int, Modality, Vehicles

RATE = 0.82  # share of the objects that a source finds where it works
_CHANCE = 0.1  # share of them near which a blind one reports something
_PRIOR = 4.0  # log-odds that a source works
_MAX_CHANGE = 12.0  # largest change of these by what it has found
_MEMORY_S = 4.0  # time constant of the memory of that
_FIRST_S = 1.0  # time that the first frame counts for
_MIN_IOU = 0.3  # minimum IoU of a detection in the image with the object that it finds


class SourceRecord:
    """Remembers what each modality has found in the image of each camera."""

    def __init__(self) -> None:
        """Start without a frame: all sources are taken to work."""
        # Time of the last frame, and change of the log-odds by the frames so far, of each camera and modality.
        self._changes: dict[tuple[int, str], tuple[float, float]] = {}

    def works(self, camera: int, modality: Modality) -> float:
        """Return the probability that a modality works in the image of a camera."""
        _, change = self._changes.get((camera, modality), (0.0, 0.0))
        return float(probability(np.array(_PRIOR + change)))

    def blind(self, camera: int) -> list[Modality]:
        """Return the modalities that do not see what others see in the image of a camera."""
        return [name for name in MODALITIES if self.works(camera, name) < 1 / 2]

    def update(
        self, stamp_s: float, vehicles: Vehicles, scenes: Sequence[DetectedScene | None]
    ) -> None:
        """Note what each source has found of the vehicles of one frame.

        Args:
            stamp_s: Time of the frame.
            vehicles: Vehicles of all sources, each once, before they are tracked.
            scenes: All detections in each camera, also those of blind sources.
        """
        for camera, scene in enumerate(scenes):
            rows = np.flatnonzero(vehicles.cameras == camera)
            if scene is None:
                continue
            for modality, found in scene.modality_detections.items():
                held = _held_by_others(vehicles, rows, scene, modality)
                overlap = iou_px(vehicles.fused.detections.boxes_px[rows], found.boxes_px)
                is_found = overlap.max(axis=1, initial=0.0) >= _MIN_IOU
                last_s, change = self._changes.get((camera, modality), (stamp_s - _FIRST_S, 0.0))
                elapsed_s = max(stamp_s - last_s, 0.0)
                change = remembered(elapsed_s, _MEMORY_S) * change + float(
                    added(_evidence(held, is_found), elapsed_s, _MEMORY_S)
                )
                limited = float(np.clip(change, -_MAX_CHANGE, _MAX_CHANGE))
                self._changes[camera, modality] = stamp_s, limited


def unseen_odds(works: Float64) -> Float64:
    """Return the log-odds that objects are there although a source misses them which works with (M,) probabilities."""
    return np.log(1 - RATE * works)


def _held_by_others(
    vehicles: Vehicles, rows: Int, scene: DetectedScene, modality: Modality
) -> Float64:
    """Return the (R,) probabilities that vehicles of some rows exist, by other sources than a modality; 0 of its own."""
    fused, scores = vehicles.fused, np.zeros(len(rows))
    for name, found in scene.modality_detections.items():
        if name != modality:
            places = fused.source_indices[rows, MODALITIES.index(name)]
            scores = np.maximum(scores, np.append(found.scores, 0.0)[places])
    is_held = (scores > 0) | np.isfinite(vehicles.bev_scores[rows])
    return np.where(is_held, np.maximum(scores, fused.existence[rows]), 0.0)


def _evidence(existence: Float64, is_found: Bool) -> float:
    """Return the log-likelihood ratio that a source works rather than is blind, by (M,) objects of some existence."""
    rates = _CHANCE + (RATE - _CHANCE) * existence
    ratios = np.where(is_found, rates / _CHANCE, (1 - rates) / (1 - _CHANCE))
    return float(np.log(ratios).sum())
