"""Detections of labelled drives, split for the training, validation and test of their fusion."""

import logging
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, partial

from data.array_store import ArrayStore
from data.batch.parts import fill_together
from data.detections.cached_detections import (
    FingerprintedDetector,
    detect_drives,
    detected_scene,
    detections_key,
)
from data.detections.config import DetectorModelPaths, FusionDataConfig
from data.detections.detected_frames import DetectedFrames
from data.detections.unlearned_frames import without_learned_frames
from data.open_drive import open_drives
from data.recorded_drive import RecordedDrive
from data.samples.config import TrainingDrives
from data.samples.labelled_parts import LabelledParts, warn_of_few
from data.splits.draw import draw_split
from data.splits.files import read_split
from data.splits.parts import SplitBy
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.detectors.multimodal import MultimodalDetector
from perception.detection.fusion.detector_fusion import detector_fingerprints
from perception.errors import PerceptionError, UsageError
from perception.types import Drive, Modality, Progress

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class SplitDetections:
    """Detections in labelled frames.

    Attributes:
        training: Frames that the fusion is fitted to.
        validation: Frames that stop the training and calibrate its scores.
        test: Frames on which the result is evaluated.
        class_names: Classes that two detectors or more know.
        detectors: Fingerprints of the detectors, for the model file.
        provenance: Split and frames of the training, for the model file.
    """

    training: DetectedFrames
    validation: DetectedFrames
    test: DetectedFrames
    class_names: tuple[str, ...]
    detectors: str
    provenance: Mapping[str, str]


def split_detections(
    sources: TrainingDrives,
    models: DetectorModelPaths,
    config: FusionDataConfig,
    seed: int,
    progress: Progress = iter,
) -> SplitDetections:
    """Detect in all frames that no detector learned from, or read the cached detections, and split them.

    Args:
        sources: Labelled drives, or a split of them.
        models: Model files of the detectors.
        config: Shares of a drawn split, and cache.
        seed: Seed of the draw.
        progress: Wrapper of the loop over frames that may show its progress.

    Raises:
        UsageError: the detectors learned from all frames, or nothing is left of a part.
        PerceptionError: a drive, a frame or a model cannot be read or used.
    """
    detectors = models.open()
    class_names = fused_classes(detectors)
    fingerprints = detector_fingerprints(detectors)
    parts = fusion_parts(sources, config, seed, detectors)
    fingerprinted = FingerprintedDetector(MultimodalDetector(detectors), fingerprints)
    store = ArrayStore(config.cache, int(config.cache_gb * 1e9))
    missing = [
        (drive, index)
        for drive in (*parts.train, *parts.val, *parts.test)
        for index in range(len(drive))
        if detections_key(drive, index, fingerprints) not in store
    ]
    fill_together(partial(_detect_in, models, store), missing, config.cache_workers, progress)
    training, validation, test = (
        detect_drives(drives, fingerprinted, store, config.on_bad_frame, progress)
        for drives in (parts.train, parts.val, parts.test)
    )
    for part, frames in (("validation", validation), ("test", test)):
        types = Counter(frames.truth.types.astype(str).tolist())
        warn_of_few(class_names, types, f"{len(frames)} frames of the {part} of the fusion")
    return SplitDetections(
        training, validation, test, class_names, fingerprints, parts.provenance()
    )


def _detect_in(
    models: DetectorModelPaths, store: ArrayStore, frames: Sequence[tuple[Drive, int]]
) -> None:
    """Cache the detections in some frames; who needs those of a faulty one meets the fault again."""
    detectors = _open(models)
    for drive, index in frames:
        with suppress(PerceptionError):
            detected_scene(drive, index, detectors, store)


@cache
def _open(models: DetectorModelPaths) -> FingerprintedDetector:
    detectors = models.open()
    return FingerprintedDetector(MultimodalDetector(detectors), detector_fingerprints(detectors))


def fusion_parts(
    sources: TrainingDrives,
    config: FusionDataConfig,
    seed: int,
    detectors: Mapping[Modality, ModalityDetector],
) -> LabelledParts:
    """Return the frames of each part that no detector learned from.

    Of a split file, train and val are drawn again, as the detectors learned from most of them; its test, where it has one,
    stays the test.

    Args:
        sources: Labelled drives, or a split of them.
        config: Shares of a drawn split.
        seed: Seed of the draw.
        detectors: Detectors of the modalities.

    Raises:
        UsageError: the detectors learned from all frames, or nothing is left of a part.
    """
    if sources.validation:
        train, kept = (
            without_learned_frames(open_drives(paths), detectors)
            for paths in (sources.training, sources.validation)
        )
        halves = draw_split(kept, (50, 50), by=_unit(config, kept), seed=seed)
        return LabelledParts(train, halves.select(kept, "train"), halves.select(kept, "val"))
    if sources.split is None:
        drives = without_learned_frames(open_drives(sources.training), detectors)
        drawn = draw_split(drives, config.shares, by=_unit(config, drives), seed=seed)
        return LabelledParts.of(drawn, drives)
    split = read_split(sources.split)
    opened = split.open(sources.training)
    drives = without_learned_frames(split.select(opened, "train", "val"), detectors)
    tested, shares = split.select(opened, "test"), config.shares
    if tested:
        whole = shares[0] + shares[1]
        shares = (100 * shares[0] / whole, 100 * shares[1] / whole)
    drawn = draw_split(drives, shares, by=_unit(config, drives), seed=seed)
    parts = replace(LabelledParts.of(drawn, drives), split=split.fingerprint)
    return replace(parts, test=without_learned_frames(tested, detectors)) if tested else parts


def fused_classes(detectors: Mapping[Modality, ModalityDetector]) -> tuple[str, ...]:
    """Return the classes that two detectors or more know, and log the others, which cannot be fused.

    Raises:
        UsageError: no two of them have a class in common.
    """
    counts = Counter(name for one in detectors.values() for name in one.class_names)
    fused = tuple(name for name, count in counts.items() if count > 1)
    if not fused:
        raise UsageError(
            "detectors",
            expected="a class that two of them or more detect",
            found="; ".join(
                f"{key} {', '.join(one.class_names)}" for key, one in detectors.items()
            ),
        )
    if others := sorted(counts.keys() - set(fused)):
        log.warning("not fused: %s, which a single detector detects", ", ".join(others))
    return fused


def _unit(config: FusionDataConfig, drives: Sequence[RecordedDrive]) -> SplitBy:
    """Return the unit of a draw: frames where there are not several drives."""
    return config.split_by if len(drives) > 1 else "frames"
