"""Settings of the detections that the fusion is trained on."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from data.samples.config import DriveDataConfig
from perception.detection.config import DEFAULT_NMS, NmsConfig
from perception.types import MODALITIES, Modality

if TYPE_CHECKING:
    from perception.detection.detectors.modality_detector import ModalityDetector


@dataclass(frozen=True)
class DetectorModelPaths:
    """Model files of the detectors that are fused; else those that ship.

    Attributes:
        rgb: Detector of the camera image.
        dm: Detector of the depth map.
        rm: Detector of the reflectance map.
    """

    rgb: Path | None = None
    dm: Path | None = None
    rm: Path | None = None

    def open(self, nms: NmsConfig = DEFAULT_NMS) -> "dict[Modality, ModalityDetector]":
        """Open all three.

        Args:
            nms: Score threshold and suppression.

        Raises:
            ModelError: there is no such file, or it holds no detector.
        """
        from perception.detection.detectors.modality_detector import ModalityDetector

        files = {name: getattr(self, name) or name for name in MODALITIES}
        return {name: ModalityDetector(file, threads=1, nms=nms) for name, file in files.items()}

    def fingerprint(self) -> str:
        """Return a hash of the three files."""
        from data.detections.cached_detections import models_fingerprint
        from perception.detection.onnx_model import shipped_model

        files = {
            name: getattr(self, name) or shipped_model(f"{name}_compact") for name in MODALITIES
        }
        return models_fingerprint({name: file.read_bytes() for name, file in files.items()})


@dataclass(frozen=True)
class FusionDataConfig(DriveDataConfig):
    """Frames for the training, validation and test of the fusion.

    Attributes:
        validation_fraction: Fraction of the frames or drives kept back, where no validation drives are given.
            Half of it stops the training and calibrates scores, the other half is for the test.
    """

    validation_fraction: float = 0.25
