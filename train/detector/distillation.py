"""Distillation from the initial weights: what they know of photographs is kept where synthetic labels say nothing.

The teacher is a frozen copy of the network that a training starts from, so that both predict at the same places.
"""

from copy import deepcopy

import torch
from torch import Tensor

from train.box_overlap import paired_iou, pairwise_iou
from train.detector.config import DistillationConfig
from train.detector.targets import BatchLabels, has_area
from train.networks.yolo_detector import YoloDetector
from train.networks.yolo_head import DecodedBoxes

_MIN_SCORE = 1e-6  # of a probability whose logarithm is taken


class Distillation:
    """The initial weights of a training, and the distance to their predictions."""

    def __init__(self, network: YoloDetector, config: DistillationConfig) -> None:
        """Copy a network.

        Args:
            network: Network with its initial weights.
            config: Weight of the distance; at 0, nothing is copied.
        """
        self._config = config
        self._teacher = deepcopy(network).eval().requires_grad_(False) if config.weight else None

    def loss(self, images: Tensor, learned: DecodedBoxes, labels: BatchLabels) -> Tensor:
        """Return the weighted distance of the predictions for a batch to those of the initial weights.

        Args:
            images: (B, C, H, W) images of 0..255.
            learned: Predictions of the network that is trained.
            labels: Labels of the images.
        """
        if self._teacher is None:
            return learned.scores.new_zeros(())
        teacher = self._teacher.to(images.device)
        with torch.no_grad():
            known = teacher.decode(teacher(images))
        with torch.autocast(images.device.type, enabled=False):
            return self._config.weight * distance(
                learned, known, _is_unlabelled(known.boxes_px, labels, self._config.max_iou)
            )


def distance(learned: DecodedBoxes, known: DecodedBoxes, is_counted: Tensor) -> Tensor:
    """Return the distance of predictions to those of a teacher, per object that the teacher sees.

    Scores differ by their relative entropy; boxes by 1 - IoU, weighted by the square of the teacher's score.

    Args:
        learned: Predictions of the student.
        known: Predictions of the teacher.
        is_counted: (B, K) mask of the predictions that count.
    """
    best = known.scores.amax(dim=-1)
    scores = (_entropy(learned.scores, known.scores) - _entropy(known.scores, known.scores)).sum(-1)
    iou = paired_iou(learned.boxes_px.flatten(0, 1), known.boxes_px.flatten(0, 1)).view_as(best)
    terms = (scores + best.square() * (1 - iou)) * is_counted
    return terms.sum() / best.sum().clamp(min=1)


def _entropy(scores: Tensor, expected: Tensor) -> Tensor:
    """Return the cross-entropy of scores 0..1 for expected ones."""
    within = scores.clamp(_MIN_SCORE, 1 - _MIN_SCORE)
    return -(expected * within.log() + (1 - expected) * (1 - within).log())


def _is_unlabelled(boxes_px: Tensor, labels: BatchLabels, max_iou: float) -> Tensor:
    """Return the (B, K) mask of boxes that lie on no label, ignored ones included."""
    is_label = has_area(labels.boxes_px)[:, None]
    lies_on = (pairwise_iou(boxes_px, labels.boxes_px) > max_iou) & is_label
    return ~lies_on.any(dim=2)
