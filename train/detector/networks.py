"""The detectors' networks, with random weights or read from a checkpoint."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from data.samples.images.input_images import ImageConfig
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.modalities import CHANNELS
from perception.errors import UsageError
from train.checkpoints import Content, load_network
from train.exported_weights import load_exported
from train.networks.compact import CompactDetector
from train.networks.torchvision_detector import TorchvisionDetector, trunk_names
from train.networks.yolo_detector import YoloDetector
from train.networks.yolov2 import YOLOv2
from train.networks.yolox import YoloxNano

MODEL = "detector"  # kind of model in checkpoints and model files
ANCHORS = 5
# Hyperparameters of which the meaning of weights depends; the size of the input and the filling of the maps may differ.
IDENTITY = ("network", "modality", "classes")

# From class names and channels to a network with random weights; all others are backbones of torchvision.
NETWORKS: dict[str, Callable[[Sequence[str], int], YoloDetector]] = {
    "compact": lambda class_names, channels: CompactDetector(class_names, channels=channels),
    "yolov2": lambda class_names, channels: YOLOv2(class_names, channels=channels),
    "yolox-nano": YoloxNano,
}


@dataclass(frozen=True)
class DetectorNetworkConfig(ImageConfig):
    """Input of a detector, and its network.

    Attributes:
        network: Network: compact, yolov2, yolox-nano, or the torchvision classifier of its backbone.
    """

    network: str = "compact"

    @property
    def metadata(self) -> dict[str, str]:
        """Texts that model files state."""
        metadata = {
            "kind": MODEL,
            "network": self.network,
            "modality": self.modality,
            "classes": ",".join(self.class_names),
            "input_height": str(self.size.height_px),
            "input_width": str(self.size.width_px),
            "filling": self.filling,
            "fit": self.fit,
        }
        compression = {"jpeg_quality": str(self.jpeg_quality)} if self.jpeg_quality else {}
        return metadata | compression

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, Any]) -> Self:
        """Return the configuration that a model file or checkpoint states."""
        quality = metadata.get("jpeg_quality")
        return cls(
            modality=metadata["modality"],
            network=metadata["network"],
            class_names=tuple(metadata["classes"].split(",")),
            size=InputSize(int(metadata["input_height"]), int(metadata["input_width"])),
            filling=metadata["filling"],
            jpeg_quality=None if quality is None else int(quality),
            fit=metadata.get("fit", "letterbox"),
        )


def make_detector(config: DetectorNetworkConfig) -> YoloDetector:
    """Return a network with random weights.

    Raises:
        UsageError: there is no network of this name.
    """
    channels = CHANNELS[config.modality]
    if config.network in NETWORKS:
        return NETWORKS[config.network](config.class_names, channels)
    if config.network in trunk_names():
        return TorchvisionDetector(config.network, config.class_names, channels=channels)
    raise UsageError(
        "network",
        expected=f"{', '.join(NETWORKS)}, or a classifier of torchvision such as resnet18",
        found=config.network,
    )


def load_detector(file: Path) -> tuple[YoloDetector, dict[str, str]]:
    """Return a trained network in evaluation mode, and the metadata of its model file.

    Args:
        file: Checkpoint, or model file of yolox-nano; batch norm, which the others have, does not come back from a file.

    Raises:
        ModelError: the file is damaged, or of another kind of network.
    """

    def make(content: Content) -> tuple[YoloDetector, dict[str, str]]:
        config = DetectorNetworkConfig.from_metadata(content["hyper_parameters"])
        return make_detector(config), config.metadata

    def of_file(stated: Mapping[str, str]) -> YoloDetector:
        config = DetectorNetworkConfig.from_metadata(stated)
        if config.network != "yolox-nano":
            raise UsageError("network", expected="yolox-nano", found=config.network)
        return make_detector(config)

    if file.suffix == ".onnx":
        return load_exported(file, MODEL, of_file, "detector.")
    detector, metadata = load_network(file, MODEL, make)
    anchors = anchors_text(detector)
    return detector, metadata | ({"anchors": anchors} if anchors else {})


def anchors_text(detector: YoloDetector) -> str:
    """Return widths and heights of the anchors in pixels, such as 19.1x13.4,37.6x22.6; empty where there are none."""
    sizes = detector.head.anchors_px.tolist()
    return ",".join(f"{width:.1f}x{height:.1f}" for width, height in sizes)
