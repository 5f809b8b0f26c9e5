"""Overlap of boxes x1 y1 x2 y2 as tensors, with gradients."""

import math

import torch
from torch import Tensor

_TINY = 1e-7


def pairwise_iou(a_px: Tensor, b_px: Tensor) -> Tensor:
    """Return (..., A, B) intersection over union of boxes (..., A, 4) and (..., B, 4)."""
    common = _intersection(a_px[..., :, None, :], b_px[..., None, :, :])
    return common / (_area(a_px)[..., :, None] + _area(b_px)[..., None, :] - common).clamp(_TINY)


def pairwise_share(a_px: Tensor, b_px: Tensor) -> Tensor:
    """Return (..., A, B) which part of each of (..., A, 4) boxes lies in each of (..., B, 4)."""
    common = _intersection(a_px[..., :, None, :], b_px[..., None, :, :])
    return common / _area(a_px)[..., :, None].clamp(_TINY)


def paired_iou(a_px: Tensor, b_px: Tensor) -> Tensor:
    """Return (N,) intersection over union of boxes (N, 4) and (N, 4) row by row."""
    common = _intersection(a_px, b_px)
    return common / (_area(a_px) + _area(b_px) - common).clamp(_TINY)


def paired_complete_iou(a_px: Tensor, b_px: Tensor) -> Tensor:
    """Return (N,) CIoU row by row: IoU less distance of centres and difference of aspect.

    IoU - ρ²/c² - α v with v = 4/π² (atan w/h - atan w'/h')², α = v / (1 - IoU + v)
    (Zheng et al., "Distance-IoU loss", AAAI 2020, eq. 10 and 11).
    """
    iou = paired_iou(a_px, b_px)
    around = torch.maximum(a_px[:, 2:], b_px[:, 2:]) - torch.minimum(a_px[:, :2], b_px[:, :2])
    apart = ((a_px[:, :2] + a_px[:, 2:]) - (b_px[:, :2] + b_px[:, 2:])) / 2
    distance = apart.square().sum(dim=1) / around.square().sum(dim=1).clamp(_TINY)
    aspect = 4 / math.pi**2 * (_aspect_rad(a_px) - _aspect_rad(b_px)).square()
    with torch.no_grad():
        trade_off = aspect / (1 - iou + aspect).clamp(_TINY)
    return iou - distance - trade_off * aspect


def _intersection(a_px: Tensor, b_px: Tensor) -> Tensor:
    low = torch.maximum(a_px[..., :2], b_px[..., :2])
    high = torch.minimum(a_px[..., 2:], b_px[..., 2:])
    return (high - low).clamp(0).prod(dim=-1)


def _area(boxes_px: Tensor) -> Tensor:
    return (boxes_px[..., 2:] - boxes_px[..., :2]).clamp(0).prod(dim=-1)


def _aspect_rad(boxes_px: Tensor) -> Tensor:
    width, height = (boxes_px[:, 2:] - boxes_px[:, :2]).unbind(dim=1)
    return torch.atan2(width, height.clamp(_TINY))
