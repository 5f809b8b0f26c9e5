"""Which networks detect, made anew or read from a checkpoint."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self, get_args

from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.modalities import CHANNELS, MapFilling
from perception.errors import ModelError, UsageError
from perception.types import MODALITIES, Modality
from train.checkpoints import read_checkpoint, weights_of
from train.networks.compact import CompactDetector
from train.networks.torchvision_detector import TorchvisionDetector, trunk_names
from train.networks.yolo_detector import YoloDetector
from train.networks.yolov2 import YOLOv2

MODEL = "detector"  # what the checkpoints say that they are of
ANCHORS = 5
_SIZE = InputSize(192, 640)

# From class names and channels to a network with random weights; all others are trunks of torchvision.
NETWORKS: dict[str, Callable[[Sequence[str], int], YoloDetector]] = {
    "compact": lambda class_names, channels: CompactDetector(class_names, channels=channels),
    "yolov2": lambda class_names, channels: YOLOv2(class_names, channels=channels),
}


@dataclass(frozen=True)
class DetectorNetworkConfig:
    """What a detector looks at and for.

    Attributes:
        modality: rgb, dm or rm.
        network: compact, yolov2, or the name of a trunk of torchvision.
        class_names: in the order of the scores.
        size: of the pictures that it is made for.
        filling: how the maps are made dense.
    """

    modality: Modality
    network: str = "compact"
    class_names: tuple[str, ...] = ("Car",)
    size: InputSize = _SIZE
    filling: MapFilling = "default"

    def __post_init__(self) -> None:
        """Refuse a modality that there is not."""
        if self.modality not in MODALITIES:
            raise UsageError("modality", expected=" or ".join(MODALITIES), found=self.modality)

    @property
    def metadata(self) -> dict[str, str]:
        """Say the same in words, as model files do."""
        return {
            "kind": MODEL,
            "network": self.network,
            "modality": self.modality,
            "classes": ",".join(self.class_names),
            "input_height": str(self.size.height_px),
            "input_width": str(self.size.width_px),
            "filling": self.filling,
        }

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, Any]) -> Self:
        """Read what `facts` says."""
        modality: Modality = next(m for m in get_args(Modality) if m == metadata["modality"])
        return cls(
            modality=modality,
            network=metadata["network"],
            class_names=tuple(metadata["classes"].split(",")),
            size=InputSize(int(metadata["input_height"]), int(metadata["input_width"])),
            filling=metadata["filling"],
        )


def make_detector(network_config: DetectorNetworkConfig) -> YoloDetector:
    """Return a network with random weights.

    Raises:
        UsageError: there is none of this name.
    """
    channels = CHANNELS[network_config.modality]
    if network_config.network in NETWORKS:
        return NETWORKS[network_config.network](network_config.class_names, channels)
    if network_config.network in trunk_names():
        return TorchvisionDetector(
            network_config.network, network_config.class_names, channels=channels
        )
    raise UsageError(
        "network",
        expected=f"{', '.join(NETWORKS)}, or a trunk of torchvision such as resnet18",
        found=network_config.network,
    )


def load_detector(checkpoint: Path) -> tuple[YoloDetector, dict[str, str]]:
    """Return a trained network, ready to detect, and what a model file says of it.

    Raises:
        ModelError: where the checkpoint is damaged, or of another kind of network.
    """
    content = read_checkpoint(checkpoint, MODEL)
    hyper_parameters = content["hyper_parameters"]
    network_config = DetectorNetworkConfig.from_metadata(hyper_parameters)
    detector = make_detector(network_config)
    try:
        detector.load_state_dict(weights_of(content, "network"))
    except RuntimeError as error:
        found = "weights of other sizes"
        raise ModelError(
            checkpoint, expected=f"weights of {network_config.network}", found=found
        ) from error
    provenance = {name: str(hyper_parameters[name]) for name in ("training_data", "revision")}
    anchors = {"anchors": anchor_words(detector), "epochs": str(content["epoch"] + 1)}
    return detector.eval(), network_config.metadata | anchors | provenance


def anchor_words(detector: YoloDetector) -> str:
    """Return widths and heights of the anchors in pixels, such as 19.1x13.4,37.6x22.6."""
    sizes = detector.head.anchors_px.tolist()
    return ",".join(f"{width:.1f}x{height:.1f}" for width, height in sizes)


def require_same_form(checkpoint: Path, network_config: DetectorNetworkConfig) -> None:
    """Refuse to go on, or to start, from a detector of other pictures, classes or layers.

    Another size of the input or another filling of the maps is no hindrance.

    Raises:
        ModelError: where it is missing, damaged, of another kind, or differs.
    """
    hyper_parameters = read_checkpoint(checkpoint, MODEL)["hyper_parameters"]
    for name in ("network", "modality", "classes"):
        expected, found = network_config.metadata[name], str(hyper_parameters[name])
        if expected != found:
            raise ModelError(
                checkpoint,
                expected=f"a detector whose {name} is {expected}",
                found=found,
                advice="give the options that the checkpoint was made with",
            )
