"""The loss of YOLOv2 as published, with two options: CIoU of boxes, and focal loss of objectness.

Published is a sum of squares over all predictions of an image (Redmon et al., "You only look once", CVPR 2016,
eq. 3), with the weights of `yolov2.cfg`. A square counts half, so that its gradient is the difference itself,
and the published learning rates mean the same here.
"""

from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional
from torchvision import ops  # type: ignore[import-untyped]

from train.box_overlap import paired_iou, pairwise_iou
from train.detector.config import DetectionLossConfig
from train.detector.targets import (
    BatchLabels,
    GridTargets,
    PredictionGrid,
    assign_targets,
    has_area,
)
from train.networks.yolo_head import BOX, CLASSES, OBJECTNESS, YoloHead, box_corners

MIN_IGNORED_SHARE = 0.5  # of a box within an ignored area


class DetectionLoss(NamedTuple):
    """Weighted terms per image, or per cell that answers where there are no anchors.

    Attributes:
        total: Sum of the others.
        box: Boxes of the responsible predictions.
        objects: Objectness of the responsible predictions.
        no_objects: Objectness of the background.
        classes: Cross-entropy of the classes.
        prior: Distance of all other boxes to their anchors, 0 after the first images.
        distillation: Distance to the predictions of the initial weights, 0 where it is not trained.
    """

    total: Tensor
    box: Tensor
    objects: Tensor
    no_objects: Tensor
    classes: Tensor
    prior: Tensor
    distillation: Tensor = torch.zeros(())

    def with_distillation(self, term: Tensor) -> "DetectionLoss":
        """Return the loss with the distance to the predictions of the initial weights."""
        return self._replace(total=self.total + term, distillation=term)


def detection_loss(
    raw: Tensor,
    labels: BatchLabels,
    head: YoloHead,
    config: DetectionLossConfig,
    images_seen: int,
) -> DetectionLoss:
    """Return the loss of a batch, in float32 whatever the precision of the network.

    Args:
        raw: (B, A, 5 + classes, rows, columns) raw predictions.
        labels: Labels of the B images.
        head: Head that made the predictions.
        config: Terms and weights.
        images_seen: Number of images trained on before.
    """
    with torch.autocast(raw.device.type, enabled=False):
        raw = raw.float()
        rows, columns = raw.shape[-2:]
        targets = assign_targets(
            labels, head.anchors_px, PredictionGrid(rows, columns, head.stride_px)
        )
        corners = box_corners(head.decode_boxes(raw))
        class_logits = _at(raw, targets)[:, CLASSES]
        class_term = functional.cross_entropy(class_logits, targets.classes, reduction="sum")
        terms = (
            config.box_weight * _box_term(raw, corners, targets, config),
            config.object_weight * _object_term(raw, corners, targets, config),
            config.no_object_weight * _no_object_term(raw, corners, labels, targets, config),
            config.class_weight * class_term,
            _prior_term(raw, targets, config, images_seen),
        )
        of_one = [term / len(raw) for term in terms]
    return DetectionLoss(torch.stack(of_one).sum(), *of_one)


def _box_term(
    raw: Tensor, corners: Tensor, targets: GridTargets, config: DetectionLossConfig
) -> Tensor:
    weight = 2 - targets.area_shares.clamp(max=1)
    if config.box == "ciou":
        errors: Tensor = ops.complete_box_iou_loss(_at(corners, targets), targets.boxes_px)
        return (weight * errors).sum()
    return (weight * _squared(_corrections(_at(raw, targets)), targets.offsets).sum(dim=1)).sum()


def _object_term(
    raw: Tensor, corners: Tensor, targets: GridTargets, config: DetectionLossConfig
) -> Tensor:
    """Train objectness towards the IoU that the box reaches."""
    reached = paired_iou(_at(corners, targets), targets.boxes_px).detach()
    return objectness_error(_at(raw, targets)[:, OBJECTNESS], reached, config).sum()


def _no_object_term(
    raw: Tensor,
    corners: Tensor,
    labels: BatchLabels,
    targets: GridTargets,
    config: DetectionLossConfig,
) -> Tensor:
    """Train objectness towards 0 where a prediction is neither responsible for a label nor on one."""
    is_free = _lies_on_label(corners.detach(), labels, config.ignore_iou) | _is_responsible(
        raw, targets
    )
    logits = raw[:, :, OBJECTNESS]
    errors = objectness_error(logits, torch.zeros_like(logits), config)
    return errors.masked_fill(is_free, 0).sum()


def _prior_term(
    raw: Tensor, targets: GridTargets, config: DetectionLossConfig, images_seen: int
) -> Tensor:
    if images_seen >= config.prior_images:
        return raw.new_zeros(())
    corrections = _corrections(raw[:, :, BOX].movedim(2, -1))
    of_anchor = corrections.new_tensor([0.5, 0.5, 0, 0]).expand_as(corrections)
    errors = _squared(corrections, of_anchor).sum(dim=-1)
    return config.prior_weight * errors.masked_fill(_is_responsible(raw, targets), 0).sum()


def objectness_error(logits: Tensor, target: Tensor, config: DetectionLossConfig) -> Tensor:
    """Return the loss of each prediction's objectness for a target of 0 to 1."""
    scores = logits.sigmoid()
    if config.objectness == "squared":
        return _squared(scores, target)
    # The continuous form of the focal loss (Li et al., "Generalized focal loss", NeurIPS 2020, eq. 3), equal to
    # torchvision's at targets of 0 and 1. Between them, where the reached IoU lies, torchvision's is not smallest at
    # the target itself.
    entropy = functional.binary_cross_entropy_with_logits(logits, target, reduction="none")
    return (target - scores).abs() ** config.focal_gamma * entropy


def _lies_on_label(corners: Tensor, labels: BatchLabels, ignore_iou: float) -> Tensor:
    """Return the (B, A, rows, columns) mask of boxes on a label or mostly in an ignored area."""
    batch, anchors, _, rows, columns = corners.shape
    boxes_px = corners.permute(0, 1, 3, 4, 2).reshape(batch, -1, 4)
    is_real = has_area(labels.boxes_px)[:, None]
    is_ignored = labels.is_ignored[:, None]
    on_label = (pairwise_iou(boxes_px, labels.boxes_px) > ignore_iou) & ~is_ignored
    in_ignored = (shares_within(boxes_px, labels.boxes_px) > MIN_IGNORED_SHARE) & is_ignored
    lies = ((on_label | in_ignored) & is_real).any(dim=2)
    return lies.reshape(batch, anchors, rows, columns)


def shares_within(boxes_px: Tensor, areas_px: Tensor) -> Tensor:
    """Return (B, M, K) shares of the boxes (B, M, 4) that lie within areas (B, K, 4)."""
    iou = pairwise_iou(boxes_px, areas_px)
    # With an intersection I of areas A and B: IoU = I / (A + B - I), hence I / A = IoU / (1 + IoU) (1 + B / A).
    area_ratios = _areas(areas_px)[:, None] / _areas(boxes_px)[..., None]
    return iou / (1 + iou) * (1 + area_ratios)


def _areas(boxes_px: Tensor) -> Tensor:
    return (boxes_px[..., 2:] - boxes_px[..., :2]).prod(dim=-1)


def _is_responsible(raw: Tensor, targets: GridTargets) -> Tensor:
    """Return the (B, A, rows, columns) mask of the predictions responsible for a label."""
    batch, anchors, _, rows, columns = raw.shape
    is_responsible = torch.zeros(batch, anchors, rows, columns, dtype=torch.bool, device=raw.device)
    is_responsible[targets.image, targets.anchor, targets.row, targets.column] = True
    return is_responsible


def _at(maps: Tensor, targets: GridTargets) -> Tensor:
    """Return the (N, values) of (B, A, values, rows, columns) maps at the responsible predictions."""
    return maps.movedim(2, -1)[targets.image, targets.anchor, targets.row, targets.column]


def _corrections(raw: Tensor) -> Tensor:
    """Return (..., 4) σ(t_x), σ(t_y), t_w, t_h."""
    return torch.cat([raw[..., :2].sigmoid(), raw[..., 2:4]], dim=-1)


def _squared(value: Tensor, target: Tensor) -> Tensor:
    return (value - target).square() / 2
