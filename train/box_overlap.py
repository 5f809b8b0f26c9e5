"""Overlap of boxes x1 y1 x2 y2 as tensors, by torchvision's operators."""

import torch
from torch import Tensor
from torchvision import ops  # type: ignore[import-untyped]

# The operator takes a batch of images from torchvision 0.24 on only.
_batched_iou = torch.vmap(ops.box_iou)


def pairwise_iou(a_px: Tensor, b_px: Tensor) -> Tensor:
    """Return (B, M, K) intersection over union of the boxes (B, M, 4) and (B, K, 4) of B images."""
    iou: Tensor = _batched_iou(a_px, b_px)
    return iou


def paired_iou(a_px: Tensor, b_px: Tensor) -> Tensor:
    """Return (N,) intersection over union of boxes (N, 4) and (N, 4) row by row; 0 of two without area."""
    return pairwise_iou(a_px[:, None], b_px[:, None])[:, 0, 0].nan_to_num()
