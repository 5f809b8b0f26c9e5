"""Labels of single images, padded to a batch."""

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from train.detector.targets import BatchLabels


class ImageLabels(NamedTuple):
    """Targets of one image.

    Attributes:
        boxes_px: (M, 4) x1 y1 x2 y2 in pixels of the network's input.
        classes: (M,) indices into the detector's class names.
        is_ignored: (M,) mask of the areas in which detections are neither right nor wrong, such as KITTI's DontCare.
    """

    boxes_px: Tensor
    classes: Tensor
    is_ignored: Tensor


def pad_labels(labels: Sequence[ImageLabels]) -> BatchLabels:
    """Return the labels of several images as one batch."""
    padded = [
        torch.nn.utils.rnn.pad_sequence(list(parts), batch_first=True)
        for parts in zip(*labels, strict=True)
    ]
    return BatchLabels(*padded)
