"""Detections in labelled drives, cached in an `ArrayStore`.

An entry is of one frame: boxes, scores and types of each modality, and depths of the boxes. Its key holds all that
determines it: the frame's files, the model files, and the code.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import perception.detection
import perception.detection.detectors
import perception.detection.fusion
import perception.maps
from data.array_store import Arrays, ArrayStore, entry_key
from data.detections.detected_frames import DetectedFrames
from data.frame_fingerprint import code_fingerprint, frame_fingerprint
from data.frames import frame_name
from perception.detection.detectors.multimodal import MultimodalDetector
from perception.detection.fusion.detected_scene import DetectedScene
from perception.errors import DriveError, PerceptionError
from perception.evaluation.detection.box_rows import TrueBoxes
from perception.types import (
    MODALITIES,
    Detections,
    Drive,
    Frame,
    Labels,
    Modality,
    OnBadFrame,
    Progress,
)

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class FingerprintedDetector:
    """Detectors with the fingerprint of their model files.

    Attributes:
        detector: Detectors of one or more modalities.
        fingerprint: Hash of the model files.
    """

    detector: MultimodalDetector
    fingerprint: str


def detect_drives(
    drives: Sequence[Drive],
    detectors: FingerprintedDetector,
    store: ArrayStore,
    on_bad_frame: OnBadFrame = "stop",
    progress: Progress = iter,
) -> DetectedFrames:
    """Return the detections in the frames of labelled drives.

    Args:
        drives: Drives with labels.
        detectors: Detectors, run on the frames that are not cached.
        store: Cache of the detections.
        on_bad_frame: Stop at a damaged frame, or skip it with a warning.
        progress: Wrapper of the loop over frames that may show its progress.

    Raises:
        DriveError: there is no frame.
        PerceptionError: a frame cannot be read or used, and `on_bad_frame` is "stop".
    """
    frames = [(drive, index) for drive in drives for index in range(len(drive))]
    scenes: list[DetectedScene] = []
    labels: list[Labels] = []
    for position in progress(range(len(frames))):
        drive, index = frames[position]
        try:
            of_frame = drive.labels(index)
            scene = detected_scene(drive, index, detectors, store)
        except PerceptionError as error:
            if on_bad_frame == "stop":
                raise
            name = frame_name(drive, index)
            log.warning("skipped frame %s of %s: %s", name, drive.name, error)
            continue
        scenes.append(scene)
        labels.append(of_frame)
    if not scenes:
        raise DriveError("detections", expected="labelled frames", found="none")
    return DetectedFrames(tuple(scenes), TrueBoxes.of_frames(labels))


def detected_scene(
    drive: Drive, index: int, detectors: FingerprintedDetector, store: ArrayStore
) -> DetectedScene:
    """Return the detections in one frame, from the cache where it has them.

    Raises:
        PerceptionError: the frame cannot be read or used.
    """
    key = detections_key(drive, index, detectors.fingerprint)
    return _to_scene(store.get(key, lambda: _detect(drive[index], detectors.detector)))


def detections_key(drive: Drive, index: int, fingerprint: str) -> str:
    """Return the key of the detections in one frame by detectors of a fingerprint."""
    code = code_fingerprint(
        perception.detection,
        perception.detection.detectors,
        perception.detection.fusion,
        perception.maps,
        Path(__file__),
    )
    return entry_key(
        what="detections", models=fingerprint, code=code, **frame_fingerprint(drive, index)
    )


def _detect(frame: Frame, detector: MultimodalDetector) -> Arrays:
    scene = detector.detect(frame).scene
    arrays: dict[str, np.ndarray] = {"size_px": np.array(scene.size_px)}
    for name, found in scene.modality_detections.items():
        arrays[f"{name}_boxes_px"] = found.boxes_px
        arrays[f"{name}_scores"] = found.scores
        arrays[f"{name}_types"] = found.types.astype(np.str_)
    for name, class_names in scene.class_names.items():
        arrays[f"{name}_classes"] = np.array(class_names, np.str_)
    return arrays


def _to_scene(arrays: Arrays) -> DetectedScene:
    modality_detections: dict[Modality, Detections] = {}
    for name in MODALITIES:
        if f"{name}_boxes_px" in arrays:
            columns = [arrays[f"{name}_{part}"] for part in ("boxes_px", "scores", "types")]
            modality_detections[name] = Detections(*columns)
    width, height = arrays["size_px"].tolist()
    class_names = {
        name: tuple(arrays[f"{name}_classes"].tolist())
        for name in MODALITIES
        if f"{name}_classes" in arrays
    }
    return DetectedScene(modality_detections, (width, height), class_names)
