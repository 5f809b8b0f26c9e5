"""The loss of each kind of head."""

from collections.abc import Callable, Mapping
from typing import Any

from train.detector.anchor_free_loss import anchor_free_loss
from train.detector.config import DetectionLossConfig
from train.detector.losses import DetectionLoss, detection_loss
from train.detector.targets import BatchLabels
from train.networks.yolo_head import DetectionHead, YoloHead
from train.networks.yolox import YoloxHead

# From raw predictions, labels, head, weights of the terms and the number of images seen before.
HeadLoss = Callable[[Any, BatchLabels, Any, DetectionLossConfig, int], DetectionLoss]
_LOSSES: Mapping[type[DetectionHead[Any]], HeadLoss] = {
    YoloHead: detection_loss,
    YoloxHead: anchor_free_loss,
}


def head_loss(head: DetectionHead[Any]) -> HeadLoss:
    """Return the loss that the predictions of a head are trained by."""
    return _LOSSES[type(head)]
