"""The loss of an anchor-free head: which cells answer for a label, and what they learn.

A cell may answer for a label if its centre lies in the label's box and near the centre of the box. Of these the
label gets those that are cheapest by class and overlap, as many as their boxes overlap it in sum: Ge et al., "OTA:
optimal transport assignment for object detection", CVPR 2021, in the short form of YOLOX (arXiv 2107.08430, 2.1).
"""

from typing import NamedTuple

import torch
from torch import Tensor, distributed
from torch.nn import functional
from torchvision import ops  # type: ignore[import-untyped]

from train.detector.config import DetectionLossConfig
from train.detector.losses import MIN_IGNORED_SHARE, DetectionLoss, shares_within
from train.detector.targets import BatchLabels, has_area
from train.networks.yolox import CLASSES, OBJECTNESS, YoloxHead, cells, flatten_levels

_RADIUS_CELLS = 2.5  # around the centre of a label
_MOST_CELLS = 10  # that answer for one label
_OVERLAP_WEIGHT = 3.0  # of -log IoU beside the entropy of the class, in the cost of a cell
_UNLIKE = 1e5  # cost of a cell that may not answer


class Assignment(NamedTuple):
    """N cells that answer for a label, of a batch.

    Attributes:
        image: (N,) number of the image.
        cell: (N,) number of the cell.
        label: (N,) number of the label in its image.
        iou: (N,) IoU of the predicted box with the label's.
    """

    image: Tensor
    cell: Tensor
    label: Tensor
    iou: Tensor


def anchor_free_loss(
    raw: tuple[Tensor, ...],
    labels: BatchLabels,
    head: YoloxHead,
    config: DetectionLossConfig,
    images_seen: int,
) -> DetectionLoss:
    """Return the loss of a batch, in float32 whatever the precision of the network.

    Args:
        raw: Raw predictions of the head.
        labels: Labels of the B images.
        head: Head that made the predictions.
        config: Terms and weights; boxes learn by CIoU, objectness by cross-entropy.
        images_seen: Number of images trained on before, without a meaning here.
    """
    with torch.autocast(raw[0].device.type, enabled=False):
        flat, boxes_px = flatten_levels(raw), head.decode_boxes(raw)
        found = assign_cells(raw, flat.detach(), boxes_px.detach(), labels)
        at = found.image, found.cell
        targets_px = labels.boxes_px[found.image, found.label]
        is_object = torch.zeros_like(flat[..., OBJECTNESS])
        is_object[at] = 1
        is_free = _lies_in_ignored(boxes_px.detach(), labels) & (is_object == 0)
        entropy = functional.binary_cross_entropy_with_logits(
            flat[..., OBJECTNESS], is_object, reduction="none"
        ).masked_fill(is_free, 0)
        classes = functional.one_hot(
            labels.classes[found.image, found.label], len(head.class_names)
        )
        box = ops.complete_box_iou_loss(boxes_px[at], targets_px, reduction="sum")
        of_classes = functional.binary_cross_entropy_with_logits(
            flat[at][:, CLASSES], classes * found.iou[:, None], reduction="sum"
        )
        terms = (
            config.box_weight * box,
            config.object_weight * (entropy * is_object).sum(),
            config.no_object_weight * (entropy * (1 - is_object)).sum(),
            config.class_weight * of_classes,
            flat.new_zeros(()),
        )
        count = _count_in_processes(len(found.cell), flat)
        of_one = [term / count for term in terms]
    return DetectionLoss(torch.stack(of_one).sum(), *of_one)


def _count_in_processes(count: int, like: Tensor) -> Tensor | int:
    """Return the mean number of cells of all training processes, whose gradients are averaged: the loss is of all cells.

    A validation, which each process may end after another number of batches, waits for no other.
    """
    if not (distributed.is_available() and distributed.is_initialized() and like.requires_grad):
        return max(count, 1)
    total = like.new_tensor(float(count))
    distributed.all_reduce(total)
    return total.clamp(min=1) / distributed.get_world_size()


def assign_cells(
    raw: tuple[Tensor, ...], flat: Tensor, boxes_px: Tensor, labels: BatchLabels
) -> Assignment:
    """Return the cells that answer for the labels of a batch; a cell answers for one label.

    Args:
        raw: Raw predictions, for the places of their cells.
        flat: (B, K, 5 + classes) raw predictions of every cell.
        boxes_px: (B, K, 4) predicted boxes.
        labels: Labels of the B images.
    """
    corners, strides_px = cells(raw)
    centers_px = (corners + 0.5) * strides_px
    rows = [
        _assign_image(number, one, boxes_px[number], (centers_px, strides_px), labels)
        for number, one in enumerate(flat)
    ]
    return Assignment(*(torch.cat(parts) for parts in zip(*rows, strict=True)))


def _assign_image(
    number: int, flat: Tensor, boxes_px: Tensor, grid: tuple[Tensor, Tensor], labels: BatchLabels
) -> Assignment:
    is_target = has_area(labels.boxes_px[number]) & ~labels.is_ignored[number]
    rows = is_target.nonzero()[:, 0]
    targets_px, classes = labels.boxes_px[number][rows], labels.classes[number][rows]
    is_near = _is_near(targets_px, *grid)
    candidates = is_near.any(dim=0).nonzero()[:, 0]
    if not len(candidates):
        empty = rows.new_zeros(0)
        return Assignment(empty, empty, empty, flat.new_zeros(0))
    is_near = is_near[:, candidates]
    iou = ops.box_iou(targets_px, boxes_px[candidates])
    scores = (
        flat[candidates, OBJECTNESS, None].sigmoid() * flat[candidates, CLASSES].sigmoid()
    ).sqrt()
    # Logarithms of the probability that a cell sees no class but the label's.
    of_none = (1 - scores).clamp(min=1e-6).log()
    of_others = of_none.sum(dim=1) - of_none[:, classes].T
    entropy = -(scores[:, classes].T.clamp(min=1e-6)).log() - of_others
    cost = entropy - _OVERLAP_WEIGHT * (iou + 1e-8).log() + _UNLIKE * ~is_near
    iou = iou * is_near
    counts = iou.topk(min(_MOST_CELLS, len(candidates)), dim=1).values.sum(dim=1).int().clamp(min=1)
    rank = cost.argsort(dim=1).argsort(dim=1)
    is_wanted = (rank < counts[:, None]) & is_near
    # A cell that several labels want answers for the one it is cheapest for.
    best = cost.masked_fill(~is_wanted, torch.inf).argmin(dim=0)
    kept = is_wanted.any(dim=0).nonzero()[:, 0]
    return Assignment(
        torch.full_like(kept, number), candidates[kept], rows[best[kept]], iou[best[kept], kept]
    )


def _is_near(targets_px: Tensor, centers_px: Tensor, strides_px: Tensor) -> Tensor:
    """Return the (L, K) mask of the cells in a label's box and near its centre."""
    x, y = centers_px.T
    x1, y1, x2, y2 = (side[:, None] for side in targets_px.T)
    is_inside = (x > x1) & (x < x2) & (y > y1) & (y < y2)
    reach_px = _RADIUS_CELLS * strides_px[:, 0]
    is_central = ((x1 + x2) / 2 - x).abs().maximum(((y1 + y2) / 2 - y).abs()) < reach_px
    is_near: Tensor = is_inside & is_central
    return is_near


def _lies_in_ignored(boxes_px: Tensor, labels: BatchLabels) -> Tensor:
    """Return the (B, K) mask of boxes mostly in an ignored area."""
    is_area = (has_area(labels.boxes_px) & labels.is_ignored)[:, None]
    lies: Tensor = ((shares_within(boxes_px, labels.boxes_px) > MIN_IGNORED_SHARE) & is_area).any(
        dim=2
    )
    return lies
