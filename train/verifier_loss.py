"""What the training of a verifier makes small, beside the entropy of its classes: errors of boxes."""

import torch
from torch import Tensor
from torch.nn import functional


def box_loss(boxes: Tensor, targets: Tensor) -> Tensor:
    """Return the mean over M boxes x1 y1 x2 y2 of 1 - GIoU and of how far their edges are off.

    GIoU is what the measure asks for and knows no unit; the edges lead where boxes are far apart.
    """
    if len(boxes) == 0:
        return boxes.sum()
    edges = functional.smooth_l1_loss(boxes, targets, beta=0.05)
    return (1 - generalised_iou(boxes, targets)).mean() + edges


def generalised_iou(boxes: Tensor, targets: Tensor) -> Tensor:
    """Return (M,) GIoU -1..1 of boxes with their targets: IoU less the empty share of the hull."""
    overlap, union = _overlap_and_union(boxes, targets)
    low = torch.minimum(boxes[:, :2], targets[:, :2])
    high = torch.maximum(boxes[:, 2:], targets[:, 2:])
    hull = (high - low).clamp(min=0).prod(1).clamp(min=1e-9)
    return overlap / union - (hull - union) / hull


def box_iou(boxes: Tensor, targets: Tensor) -> Tensor:
    """Return (M,) IoU 0..1 of boxes with their targets."""
    overlap, union = _overlap_and_union(boxes, targets)
    return overlap / union


def _overlap_and_union(boxes: Tensor, targets: Tensor) -> tuple[Tensor, Tensor]:
    low = torch.maximum(boxes[:, :2], targets[:, :2])
    high = torch.minimum(boxes[:, 2:], targets[:, 2:])
    overlap = (high - low).clamp(min=0).prod(1)
    areas = _areas(boxes) + _areas(targets)
    return overlap, (areas - overlap).clamp(min=1e-9)


def _areas(boxes: Tensor) -> Tensor:
    return (boxes[:, 2:] - boxes[:, :2]).clamp(min=0).prod(1)
