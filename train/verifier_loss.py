"""What the training of a verifier makes small, beside the entropy of its classes: errors of boxes."""

import torch
from torch import Tensor
from torch.nn import functional


def box_loss(boxes: Tensor, targets: Tensor) -> Tensor:
    """Return the mean over M boxes of how far their edges x1 y1 x2 y2 are off, in shares of the window.

    Squared below a tenth of the window: a gradient that vanishes at the goal, as that of an IoU does not.
    """
    if len(boxes) == 0:
        return boxes.sum()
    edges = functional.smooth_l1_loss(boxes, targets, beta=0.1, reduction="none")
    return edges.sum(1).mean()


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
