"""Settings of the detections that the fusion is trained on."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from data.samples.config import DriveDataConfig
from perception.detection.config import DetectionConfig
from perception.types import MODALITIES, Modality

if TYPE_CHECKING:
    from perception.detection.detectors.modality_detector import ModalityDetector

VehicleDetector = Literal["fused", "depthcn", "labels"]


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

    def open(self) -> "dict[Modality, ModalityDetector]":
        """Open all three.

        Raises:
            ModelError: there is no such file, or it holds no detector.
        """
        from perception.detection.networks import open_detectors

        return open_detectors(DetectionConfig(MODALITIES, self.rgb, self.dm, self.rm))


@dataclass(frozen=True)
class FusionDataConfig(DriveDataConfig):
    """Frames for the training, validation and test of the fusion.

    Attributes:
        shares: Percentage of the frames or drives that train, stop the training and calibrate scores, and test,
            where neither a split nor validation drives are given.
    """

    shares: tuple[float, ...] = (60, 20, 20)


@dataclass(frozen=True)
class LabelNoise:
    """Noise that makes labels look like detections.

    Attributes:
        sides: Standard deviation of each side, as a share of the box's width or height.
        missing: Share of the labels that are not detected, 0 to 1.
        seed: Seed of the noise and of the missing labels.
    """

    sides: float = 0.05
    missing: float = 0.1
    seed: int = 0
