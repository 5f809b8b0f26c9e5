"""What a fusion is fitted to and judged by: detections of labelled drives, apart from each other."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from data.detections.cached_detections import (
    FingerprintedDetector,
    detect_drives,
    models_fingerprint,
    require_no_training_drives,
)
from data.detections.detected_frames import DetectedFrames
from data.frames import OnBadFrame
from data.splitting import SplitBy, validation_frames
from data.training_drives import TrainingDrives, open_drives
from perception.cli.flags import require_drives
from perception.cli.progress import frame_progress_bar
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.detectors.multimodal import MultimodalDetector
from perception.detection.fusion.detector_fingerprints import detector_fingerprints
from perception.detection.onnx_model import shipped_model
from perception.errors import UsageError
from perception.types import MODALITIES, Modality

_SPLIT = 0xF  # stream of random numbers


@dataclass(frozen=True)
class DetectorModelPaths:
    """Which detectors are fused; those that ship where no file is named.

    Attributes:
        rgb: detector of the camera's image.
        dm: of the depth map.
        rm: of the reflectance map.
    """

    rgb: Path | None = None
    dm: Path | None = None
    rm: Path | None = None

    def open(self) -> dict[Modality, ModalityDetector]:
        """Open all three.

        Raises:
            ModelError: there is no such file, or it holds no detector.
        """
        named = {name: getattr(self, name) or name for name in MODALITIES}
        return {name: ModalityDetector(file, threads=1) for name, file in named.items()}

    def fingerprint(self) -> str:
        """Return what tells these files from others."""
        files = {
            name: getattr(self, name) or shipped_model(f"{name}_compact") for name in MODALITIES
        }
        return models_fingerprint({name: file.read_bytes() for name, file in files.items()})


@dataclass(frozen=True)
class FusionDataConfig:
    """What a fusion learns from.

    Attributes:
        drives: labelled drives.
        validation: drives that it is judged by; none keeps a share of the frames back.
        validation_fraction: of the frames or drives.
        split: keep single frames back, or whole drives.
        models: the detectors.
        on_bad_frame: stop at a damaged frame, or leave it out.
        cache: folder for what the detectors see; else the user's cache folder.
    """

    drives: tuple[Path, ...]
    validation: tuple[Path, ...] = ()
    validation_fraction: float = 0.25
    split: SplitBy = "frames"
    models: DetectorModelPaths = DetectorModelPaths()
    on_bad_frame: OnBadFrame = "stop"
    cache: Path | None = None

    def __post_init__(self) -> None:
        """Refuse nothing to learn from."""
        require_drives(self.drives)


@dataclass(frozen=True)
class SplitDetections:
    """What the detectors saw, and what they detect.

    Attributes:
        training: is learned from.
        validation: says when it is enough, and gives the curve from scores to probabilities.
        judged: nothing is fitted to; by what the fusion says there it is judged.
        class_names: what they detect.
        detectors: what tells them from others, for the model file.
    """

    training: DetectedFrames
    validation: DetectedFrames
    judged: DetectedFrames
    class_names: tuple[str, ...]
    detectors: str


def split_detections(data: FusionDataConfig, seed: int) -> SplitDetections:
    """Let the detectors look at all frames, or read what they saw; keep some frames back.

    Raises:
        UsageError: a detector learned from one of the drives, or nothing is left of a part.
        PerceptionError: a drive, a frame or a model cannot be read or used.
    """
    detectors = data.models.open()
    fingerprinted = FingerprintedDetector(MultimodalDetector(detectors), data.models.fingerprint())
    sources = TrainingDrives(data.drives, data.validation, data.cache)
    parts = []
    for paths in sources.parts:
        drives = open_drives(paths)
        require_no_training_drives(drives, detectors)
        progress_bar = frame_progress_bar("detections")
        parts.append(
            detect_drives(drives, fingerprinted, sources.store, data.on_bad_frame, progress_bar)
        )
    rng = np.random.default_rng([seed, _SPLIT])
    if len(parts) == 1:
        whole = parts[0]
        is_kept = validation_frames(whole.drive_numbers, data.validation_fraction, data.split, rng)
        parts = [whole[np.flatnonzero(~is_kept)], whole[np.flatnonzero(is_kept)]]
    training, kept = parts
    validation, judged = _halves(kept, data.split, rng)
    names = next(iter(detectors.values())).class_names
    return SplitDetections(training, validation, judged, names, detector_fingerprints(detectors))


def _halves(
    kept: DetectedFrames, split: SplitBy, rng: np.random.Generator
) -> tuple[DetectedFrames, DetectedFrames]:
    """Part what was kept back in two: by drives where whole ones were kept and there are several."""
    if len(kept) < 2:
        raise UsageError(
            "validation",
            expected="2 frames or more: by some scores become probabilities, by others these are judged",
            found=f"{len(kept)}",
            advice="raise --validation-share, or name other drives to validate on",
        )
    has_several = len(np.unique(kept.drive_numbers)) > 1
    by: SplitBy = split if has_several else "frames"
    is_test = validation_frames(kept.drive_numbers, 0.5, by, rng)
    return kept[np.flatnonzero(~is_test)], kept[np.flatnonzero(is_test)]
