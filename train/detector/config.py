"""Settings of the loss and of the initial weights of image detectors."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from perception.errors import UsageError

Anchors = Literal["auto", "default"]


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
class DistillationConfig:
    """What a training keeps of its initial weights: Hinton et al., "Distilling the knowledge", arXiv 1503.02531.

    Attributes:
        weight: Weight of the distance to the predictions of the initial weights, where no label is; 0 for none.
        max_iou: IoU with a label above which the initial weights' prediction does not count.
    """

    weight: float = 0.0
    max_iou: float = 0.3

    def __post_init__(self) -> None:
        """Validate the ranges."""
        if self.weight < 0 or not 0 <= self.max_iou <= 1:
            raise UsageError(
                "distillation",
                expected="a weight of at least 0 and a max_iou from 0 to 1",
                found=f"{self.weight:g} and {self.max_iou:g}",
            )


@dataclass(frozen=True)
class InitialWeights:
    """Weights that a training starts from, at most one of them; else random weights.

    Attributes:
        checkpoint: Checkpoint, or model file of yolox-nano, of a training of the same network on other images.
        darknet: Weight file of Darknet for yolov2, such as darknet19_448.conv.23 or a whole detector's.
        public: Public ONNX file of YOLOX-nano, for network yolox-nano of modality rgb.
        backbone: File of a torchvision classifier's state_dict, or the word download.
    """

    checkpoint: Path | None = None
    darknet: Path | None = None
    public: Path | None = None
    backbone: str | None = None

    def __post_init__(self) -> None:
        """Validate that at most one is given."""
        if len(self.given) > 1:
            raise UsageError(
                "initial weights", expected="at most one kind", found=", ".join(self.given)
            )

    @property
    def given(self) -> tuple[str, ...]:
        """Names of those that are given."""
        return tuple(name for name, value in vars(self).items() if value is not None)
