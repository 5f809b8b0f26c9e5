"""Loss of the bird's-eye view's centres: focal loss of scores, and L1 of boxes with the likelihood of their errors."""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import pixel_shuffle, softplus

from perception.detection.bev.bev_map import BevGrid
from perception.detection.bev.boxes import BOX, BOXES, DEVIATIONS, SPLIT, STRIDE
from train.networks.bev_centers import CenterMaps

_MIN_SIGMA_PLACES = 0.8
_SIGMA_PER_SIZE = 0.2  # of the root of the area of an object
_TRAINED_FROM = 0.3  # value of the bump from which on a place answers for the box
_MAX_LOG = 6.0


@dataclass(frozen=True)
class BevLossConfig:
    """Weights of the terms.

    Attributes:
        box_weight: Weight of the boxes.
        deviation_weight: Weight of the likelihood of their errors.
    """

    box_weight: float = 1.0
    deviation_weight: float = 0.05


class BevLabels(NamedTuple):
    """Targets of B maps, padded to L each with boxes of zero size.

    Attributes:
        boxes: (B, L, 7) x and y, height of the bottom, length, width, height, heading.
        classes: (B, L) indices into the class names.
        is_ignored: (B, L) mask of the objects that are neither background nor to be found.
        view_rad: (B, 2) middle and half width of the directions in which everything is labelled.
        middle_m: (B, 2) middle of the map.
    """

    boxes: Tensor
    classes: Tensor
    is_ignored: Tensor
    view_rad: Tensor
    middle_m: Tensor


class BevTargets(NamedTuple):
    """Targets at each place, and those of the P places that answer for an object.

    Attributes:
        scores: (B, K, H, W) bumps of height 1 at the centres.
        is_trained: (B, 1, H, W) mask of the places whose scores count.
        places: (3, P) map, row and column.
        weights: (P,) bumps of their objects.
        boxes: (P, 10) boxes of these.
    """

    scores: Tensor
    is_trained: Tensor
    places: Tensor
    weights: Tensor
    boxes: Tensor


class BevLoss(NamedTuple):
    """Terms of the loss, weighted.

    Attributes:
        total: Their sum.
        score: Focal loss of scores.
        box: L1 loss of boxes.
        deviation: Negative log-likelihood of their errors.
    """

    total: Tensor
    score: Tensor
    box: Tensor
    deviation: Tensor


def bev_targets(
    labels: BevLabels, place_m: float, classes: int, shape: tuple[int, int]
) -> BevTargets:
    """Lay targets over the places.

    Args:
        labels: Labels of B maps.
        place_m: Side of a place in metres.
        classes: Number of classes, K.
        shape: Rows and columns of the predictions.
    """
    batch, (rows, columns), device = len(labels.boxes), shape, labels.boxes.device
    half = torch.tensor([rows / 2, columns / 2], device=device)
    places = (labels.boxes[..., :2] - labels.middle_m[:, None]) / place_m + half
    is_inside = ((places >= 0) & (places < 2 * half)).all(dim=-1) & (labels.boxes[..., 3] > 0)
    image, place = is_inside.nonzero()[:, 0], places[is_inside]
    boxes, of_class = labels.boxes[is_inside], labels.classes[is_inside]
    is_ignored, center = labels.is_ignored[is_inside], place.floor()
    sigma = _SIGMA_PER_SIZE * (boxes[:, 3] * boxes[:, 4]).sqrt() / place_m
    sigma = sigma.clamp(min=_MIN_SIGMA_PLACES)[:, None]
    along, across = (
        (-((torch.arange(side, device=device) - center[:, axis, None]) ** 2) / (2 * sigma**2)).exp()
        for axis, side in enumerate(shape)
    )
    bumps = along[:, :, None] * across[:, None]
    counts = ~is_ignored
    scores = _highest(bumps[counts], (image * classes + of_class)[counts], batch * classes)
    scores = scores.reshape(batch, classes, rows, columns)
    weights = scores.amax(dim=1)
    ignored = _highest(bumps[is_ignored], image[is_ignored], batch)
    # The object of the highest bump answers for a place, and its box is stated there.
    number, i, j = (bumps * counts[:, None, None] >= _TRAINED_FROM).nonzero(as_tuple=True)
    bump = bumps[number, i, j]
    is_owner = bump >= weights[image[number], i, j]
    number, i, j = number[is_owner], i[is_owner], j[is_owner]
    offsets = place[number] - torch.stack([i, j], dim=1)
    owned, yaw = boxes[number], boxes[number, 6]
    turns = torch.stack([yaw.sin(), yaw.cos(), (2 * yaw).sin(), (2 * yaw).cos()], dim=1)
    is_trained = (ignored < _TRAINED_FROM) | (weights >= 1)
    is_trained &= _in_view(labels, place_m, shape)
    return BevTargets(
        scores,
        is_trained[:, None],
        torch.stack([image[number], i, j]),
        bump[is_owner],
        torch.cat([offsets, owned[:, 2:3], owned[:, 3:6].log(), turns], dim=1),
    )


def _highest(bumps: Tensor, places: Tensor, count: int) -> Tensor:
    """Return (count, H, W) the largest of the (N, H, W) bumps that are of each place, 0 without one."""
    highest = bumps.new_zeros(count, *bumps.shape[1:])
    return highest.scatter_reduce_(0, places[:, None, None].expand_as(bumps), bumps, "amax")


def bev_loss(raw: CenterMaps, labels: BevLabels, grid: BevGrid, config: BevLossConfig) -> BevLoss:
    """Return the loss of predictions."""
    logits, place_m = pixel_shuffle(raw.scores.float(), SPLIT), STRIDE * grid.cell_m
    targets = bev_targets(labels, place_m, logits.shape[1], (logits.shape[2], logits.shape[3]))
    objects = (targets.scores >= 1).sum().clamp(min=1)
    score = _focal_loss(logits, targets.scores, targets.is_trained) / objects
    image, row, column = targets.places
    parts = SPLIT * (row % SPLIT) + column % SPLIT
    blocks = raw.boxes.reshape(len(logits), BOXES + DEVIATIONS, SPLIT**2, *raw.boxes.shape[2:])
    stated = blocks[image, :, parts, row // SPLIT, column // SPLIT].float()
    boxes, log_scales = stated[:, :BOXES], stated[:, BOXES:].clamp(-_MAX_LOG, _MAX_LOG)
    errors = (boxes - targets.boxes).abs()
    share = (targets.weights / targets.weights.sum().clamp(min=1))[:, None]
    box = config.box_weight * (errors * share).sum()
    turns = _axis_turns(boxes.detach(), targets.boxes)
    likelihood = _likelihood(errors.detach(), turns, log_scales, targets.boxes, place_m)
    deviation = config.deviation_weight * (likelihood * share).sum()
    return BevLoss(score + box + deviation, score, box, deviation)


def _focal_loss(logits: Tensor, targets: Tensor, is_trained: Tensor) -> Tensor:
    """Return the focal loss with fewer penalties around a centre: Law and Deng, "CornerNet", ECCV 2018, equation 1."""
    at_center = logits[(targets >= 1) & is_trained]
    positive = softplus(-at_center) * (-at_center).sigmoid() ** 2
    around = (1 - targets).square().square() * is_trained  # 0 at the centres
    negative = softplus(logits) * logits.sigmoid().square() * around
    return positive.sum() + negative.sum()


def _likelihood(
    errors: Tensor, turns: Tensor, log_scales: Tensor, boxes: Tensor, place_m: float
) -> Tensor:
    """Return (P, 6) the negative log-likelihood of the errors by Laplace's distribution of the predicted scale.

    Errors are in metres and rad; those of the boxes themselves do not learn of it.
    """
    size_m = boxes[:, BOX.size].exp()
    position = errors[:, BOX.offset].mean(dim=1, keepdim=True) * place_m
    metres = torch.cat(
        [position, errors[:, BOX.bottom], errors[:, BOX.size] * size_m, turns], dim=1
    )
    assert metres.shape[1] == DEVIATIONS
    return metres * (-log_scales).exp() + log_scales


def _axis_turns(predicted: Tensor, true: Tensor) -> Tensor:
    """Return (P, 1) the angles between axes of boxes in rad."""
    first, second = (torch.atan2(*one[:, BOX.axis].T) for one in (predicted, true))
    twice = (first - second)[:, None]
    return torch.atan2(twice.sin(), twice.cos()).abs() / 2


def _in_view(labels: BevLabels, place_m: float, shape: tuple[int, int]) -> Tensor:
    """Return (B, H, W) which places lie in the directions in which everything is labelled."""
    x, y = (
        (torch.arange(side, device=labels.boxes.device) + 0.5 - side / 2) * place_m
        for side in shape
    )
    middle_m = labels.middle_m[:, :, None, None]
    directions = torch.atan2(y + middle_m[:, 1], x[:, None] + middle_m[:, 0])
    turns = directions - labels.view_rad[:, 0, None, None]
    off = torch.atan2(turns.sin(), turns.cos()).abs()
    return off <= labels.view_rad[:, 1, None, None] + 1e-3
