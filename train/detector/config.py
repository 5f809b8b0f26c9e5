"""Settings of the training of image detectors."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from data.samples.config import TrainingDrives
from data.samples.images.config import ImageDataConfig
from perception.errors import UsageError
from perception.types import Modality
from train.config import OptimizerConfig

Preset = Literal["default", "thesis"]
Anchors = Literal["auto", "default"]


@dataclass(frozen=True)
class DetectorModelConfig:
    """Network of a detector, and its input.

    Attributes:
        network: Network: compact, the one that ships; yolov2; or the torchvision classifier of its backbone,
            such as resnet18.
        classes: Classes to detect, as labels spell them.
        size: Height and width of the input, multiples of 32; the thesis' is 416x416.
        filling: Method by which maps are made dense: default, thesis, nearest, linear, natural; or sparse, the
            returns alone (Table B.2).
        anchors: Anchor boxes: auto fits them to the training labels; default takes the network's own, as with
            the weights of a whole Darknet detector. A training that starts from a checkpoint keeps its own.
    """

    network: str = "compact"
    classes: tuple[str, ...] = ("Car",)
    size: str = "192x640"
    filling: Literal["default", "thesis", "nearest", "linear", "natural", "sparse"] = "default"
    anchors: Anchors = "auto"


@dataclass(frozen=True)
class DetectionLossConfig:
    """Terms and weights of the detection loss; the thesis' are those of yolov2.cfg.

    Attributes:
        box: Loss of boxes: squared error of the four offsets, or CIoU.
        objectness: Loss of objectness: squared error, or focal loss.
        box_weight: Weight of boxes, `coord_scale`; small boxes count up to twice.
        object_weight: Weight of objectness where there is an object, `object_scale`.
        no_object_weight: Weight of objectness where there is none, `noobject_scale`.
        class_weight: Weight of the class scores, `class_scale`.
        prior_weight: Weight of the distance of all other boxes to their anchors in the first images.
        prior_images: Number of first images with that term.
        ignore_iou: IoU with a label above which a prediction is not trained as background, `thresh`.
        focal_gamma: Exponent of the focal loss; 2 in Lin et al., "Focal loss", ICCV 2017.
    """

    box: Literal["squared", "ciou"] = "ciou"
    objectness: Literal["squared", "focal"] = "focal"
    box_weight: float = 2.0
    object_weight: float = 5.0
    no_object_weight: float = 1.0
    class_weight: float = 1.0
    prior_weight: float = 0.01
    prior_images: int = 12_800
    ignore_iou: float = 0.6
    focal_gamma: float = 2.0


@dataclass(frozen=True)
class InitialWeights:
    """Weights that a training starts from, at most one of them; else random weights.

    Attributes:
        checkpoint: Checkpoint of a training of the same network on other images.
        darknet: Weight file of Darknet for yolov2, such as darknet19_448.conv.23 or a whole detector's.
        backbone: File of a torchvision classifier's state_dict, or the word download.
    """

    checkpoint: Path | None = None
    darknet: Path | None = None
    backbone: str | None = None

    def __post_init__(self) -> None:
        """Validate that at most one is given."""
        given = [name for name, value in vars(self).items() if value is not None]
        if len(given) > 1:
            raise UsageError("initial weights", expected="at most one kind", found=", ".join(given))


@dataclass(frozen=True)
class DetectorPreset:
    """Settings by one name.

    Attributes:
        optimizer: Optimizer and learning rate.
        loss: Terms of the loss.
        batch_size: Images per batch.
    """

    optimizer: OptimizerConfig = field(default_factory=OptimizerConfig)
    loss: DetectionLossConfig = field(default_factory=DetectionLossConfig)
    batch_size: int = 16


PUBLISHED_LOSS = DetectionLossConfig("squared", "squared", box_weight=1.0)
DETECTOR_PRESETS: Mapping[Preset, DetectorPreset] = {
    "default": DetectorPreset(OptimizerConfig(ema_decay=0.998, gradient_clip_norm=20.0)),
    # 7.2.2: 80200 iterations with these values; they are those of yolo-voc.cfg, and so its schedule.
    "thesis": DetectorPreset(
        OptimizerConfig("sgd", 0.001, 0.9, 0.0005, "darknet"), PUBLISHED_LOSS, batch_size=64
    ),
}


@dataclass(frozen=True)
class DetectorExperiment:
    """All settings of the training of a detector, which `config.yaml` records.

    Attributes:
        drives: Labelled drives.
        modality: Camera image, rgb; depth map, dm; or reflectance map, rm.
        model: Network and its input.
        data: Split, batches and augmentation.
        optimizer: Optimizer and learning rate.
        loss: Terms of the loss.
        weights: Initial weights.
    """

    drives: TrainingDrives
    modality: Modality
    model: DetectorModelConfig = field(default_factory=DetectorModelConfig)
    data: ImageDataConfig = field(default_factory=ImageDataConfig)
    optimizer: OptimizerConfig = DETECTOR_PRESETS["default"].optimizer
    loss: DetectionLossConfig = field(default_factory=DetectionLossConfig)
    weights: InitialWeights = field(default_factory=InitialWeights)
