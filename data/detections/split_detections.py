"""Detections of labelled drives, split for the training, validation and test of their fusion."""

import logging
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from data.array_store import ArrayStore
from data.detections.cached_detections import (
    FingerprintedDetector,
    detect_drives,
    require_no_training_drives,
)
from data.detections.config import DetectorModelPaths, FusionDataConfig
from data.detections.detected_frames import DetectedFrames
from data.samples.cached_frames import open_drives
from data.samples.config import SplitBy, TrainingDrives
from data.samples.labelled_classes import warn_of_few
from data.samples.splits import validation_frames
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.detectors.multimodal import MultimodalDetector
from perception.detection.fusion.class_fusion import detector_fingerprints
from perception.errors import UsageError
from perception.types import Modality, Progress

log = logging.getLogger(__name__)

_STREAM = 0xF  # stream of random numbers


@dataclass(frozen=True)
class SplitDetections:
    """Detections in labelled frames.

    Attributes:
        training: Frames that the fusion is fitted to.
        validation: Frames that stop the training and calibrate its scores.
        test: Frames on which the result is evaluated.
        class_names: Classes that all detectors know.
        detectors: Fingerprints of the detectors, for the model file.
    """

    training: DetectedFrames
    validation: DetectedFrames
    test: DetectedFrames
    class_names: tuple[str, ...]
    detectors: str


def split_detections(
    drives: TrainingDrives,
    models: DetectorModelPaths,
    config: FusionDataConfig,
    seed: int,
    progress: Progress = iter,
) -> SplitDetections:
    """Detect in all frames, or read the cached detections, and split them.

    Args:
        drives: Labelled drives that no detector was trained on.
        models: Model files of the detectors.
        config: Split and cache.
        seed: Seed of the split.
        progress: Wrapper of the loop over frames that may show its progress.

    Raises:
        UsageError: a detector was trained on one of the drives, or nothing is left of a part.
        PerceptionError: a drive, a frame or a model cannot be read or used.
    """
    detectors = models.open()
    class_names = shared_classes(detectors)
    fingerprints = detector_fingerprints(detectors)
    fingerprinted = FingerprintedDetector(MultimodalDetector(detectors), fingerprints)
    store = ArrayStore(config.cache, int(config.cache_gb * 1e9))
    parts = []
    for paths in drives.parts:
        opened = open_drives(paths)
        require_no_training_drives(opened, detectors)
        found = detect_drives(opened, fingerprinted, store, config.on_bad_frame, progress)
        parts.append(found.of_classes(class_names))
    rng = np.random.default_rng([seed, _STREAM])
    if len(parts) == 1:
        whole, fraction = parts[0], config.validation_fraction
        is_kept = validation_frames(whole.drive_numbers, fraction, config.split_by, rng)
        parts = [whole[np.flatnonzero(~is_kept)], whole[np.flatnonzero(is_kept)]]
    training, kept = parts
    validation, test = _halves(kept, config.split_by, rng)
    for part, frames in (("validation", validation), ("test", test)):
        types = Counter(frames.truth.types.astype(str).tolist())
        warn_of_few(class_names, types, f"{len(frames)} frames of the {part} of the fusion")
    return SplitDetections(training, validation, test, class_names, fingerprints)


def shared_classes(detectors: Mapping[Modality, ModalityDetector]) -> tuple[str, ...]:
    """Return the classes that all detectors know, and log the others, which cannot be fused.

    Raises:
        UsageError: they have no class in common.
    """
    names = [one.class_names for one in detectors.values()]
    shared = tuple(name for name in names[0] if all(name in one for one in names))
    if not shared:
        raise UsageError(
            "detectors",
            expected="a class that all of them detect",
            found="; ".join(
                f"{key} {', '.join(one.class_names)}" for key, one in detectors.items()
            ),
        )
    if others := sorted({name for one in names for name in one} - set(shared)):
        log.warning("not fused: %s, which not all detectors detect", ", ".join(others))
    return shared


def _halves(
    kept: DetectedFrames, split_by: SplitBy, rng: np.random.Generator
) -> tuple[DetectedFrames, DetectedFrames]:
    """Split the frames kept back in two: by drives where these were drawn and there are several."""
    if len(kept) < 2:
        raise UsageError(
            "validation",
            expected="2 frames or more, for calibration and for the test",
            found=f"{len(kept)}",
            advice="raise --data.validation-fraction, or name other drives with --validation",
        )
    has_several = len(np.unique(kept.drive_numbers)) > 1
    by: SplitBy = split_by if has_several else "frames"
    is_test = validation_frames(kept.drive_numbers, 0.5, by, rng)
    return kept[np.flatnonzero(~is_test)], kept[np.flatnonzero(is_test)]
