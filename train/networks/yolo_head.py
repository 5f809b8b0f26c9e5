"""The head of YOLOv2: boxes predicted in each cell as offsets to a few anchor boxes.

    map of C channels ---1x1---> raw (B, A, 5 + classes, rows, columns)

B images, A anchors, K = rows * columns * A boxes. A cell is `stride` pixels of the input wide and high.
The second axis but one holds x, y, width, height, objectness, and one number a class, in this order.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, Generic, NamedTuple, TypeVar

import torch
from torch import Tensor, nn

from perception.errors import UsageError

Raw = TypeVar("Raw")
BOX = slice(0, 4)
OBJECTNESS = 4
CLASSES = slice(5, None)
# exp of more would only be reached by a network that diverges, and then overflow half precision; of less, boxes
# would have no area, and their CIoU no gradient.
_MAX_LOG_SCALE = 8.0


class DecodedBoxes(NamedTuple):
    """Decoded predictions.

    Attributes:
        boxes_px: (B, K, 4) x1 y1 x2 y2 in pixels of the network's input; K runs over rows, columns, anchors.
        scores: (B, K, classes) objectness times class probability, 0..1.
    """

    boxes_px: Tensor
    scores: Tensor


class DetectionHead(nn.Module, ABC, Generic[Raw]):
    """Predict boxes from the maps of a trunk, in a form that the head alone and its loss read.

    Attributes:
        class_names: Classes in the order of the scores.
        anchors_px: (A, 2) widths and heights of the anchors in pixels of the input; without rows where there are none.
    """

    class_names: tuple[str, ...]
    anchors_px: Tensor

    @abstractmethod
    def forward(self, features: Any) -> Raw:  # noqa: ANN401 - as its trunk makes them
        """Return raw predictions."""

    @abstractmethod
    def decode(self, raw: Raw) -> DecodedBoxes:
        """Decode raw predictions in float32."""


class YoloHead(DetectionHead[Tensor]):
    """Predict boxes from a map, and read them.

    Attributes:
        class_names: Classes in the order of the raw channels.
        stride_px: Width and height of a cell in pixels.
        anchors_px: (A, 2) widths and heights of the anchors in pixels of the input.
    """

    def __init__(
        self,
        channels: int,
        stride_px: int,
        anchors_px: Sequence[tuple[float, float]],
        class_names: Sequence[str],
        first_score: float = 0.5,
    ) -> None:
        """Build it with random weights.

        Args:
            channels: Channels of the feature map.
            stride_px: Width and height of a cell of the feature map in pixels.
            anchors_px: A widths and heights.
            class_names: Classes to detect.
            first_score: Approximate initial objectness of every prediction.
        """
        super().__init__()
        _require_anchors(anchors_px)
        require_classes(class_names)
        self.class_names = tuple(class_names)
        self.stride_px = stride_px
        self.register_buffer("anchors_px", torch.tensor(anchors_px, dtype=torch.float32))
        self.convolution = nn.Conv2d(channels, len(anchors_px) * (5 + len(class_names)), 1)
        self._start_from(first_score)

    def forward(self, features: Tensor) -> Tensor:
        """Return raw predictions (B, A, 5 + classes, rows, columns)."""
        maps: Tensor = self.convolution(features)
        batch, _, rows, columns = maps.shape
        return maps.reshape(batch, len(self.anchors_px), 5 + len(self.class_names), rows, columns)

    def decode(self, raw: Tensor) -> DecodedBoxes:
        """Decode raw predictions in float32."""
        raw = raw.float()
        boxes = box_corners(self.decode_boxes(raw))
        scores = _as_list(raw[:, :, OBJECTNESS, None]).sigmoid()
        if (
            len(self.class_names) > 1
        ):  # the share of a single class is all, and takes long to compute
            scores = scores * _as_list(raw[:, :, CLASSES]).softmax(dim=2)
        return DecodedBoxes(_as_list(boxes), scores)

    def decode_boxes(self, raw: Tensor) -> Tensor:
        """Return (B, A, 4, rows, columns) centres, widths and heights in pixels.

        b_x = σ(t_x) + c_x,  b_y = σ(t_y) + c_y,  b_w = p_w exp(t_w),  b_h = p_h exp(t_h)
        (Redmon and Farhadi, "YOLO9000: better, faster, stronger", CVPR 2017, section 2).
        """
        rows, columns = raw.shape[-2:]
        corner_x = torch.arange(columns, device=raw.device, dtype=raw.dtype)[None, None, None]
        corner_y = torch.arange(rows, device=raw.device, dtype=raw.dtype)[None, None, :, None]
        x = (raw[:, :, 0].sigmoid() + corner_x) * self.stride_px
        y = (raw[:, :, 1].sigmoid() + corner_y) * self.stride_px
        scale = raw[:, :, 2:4].clamp(-_MAX_LOG_SCALE, _MAX_LOG_SCALE).exp()
        sizes = scale * self.anchors_px[None, :, :, None, None]
        return torch.cat([x[:, :, None], y[:, :, None], sizes], dim=2)

    def _start_from(self, score: float) -> None:
        bias = self.convolution.bias
        if bias is not None and score != 0.5:
            of_anchors = bias.detach().view(len(self.anchors_px), -1)
            of_anchors[:, OBJECTNESS] = logit(score)


def box_corners(boxes: Tensor) -> Tensor:
    """Return x1 y1 x2 y2 of boxes (B, A, 4, rows, columns) that are centres, widths and heights."""
    centers, halves = boxes[:, :, :2], boxes[:, :, 2:4] / 2
    return torch.cat([centers - halves, centers + halves], dim=2)


def _as_list(maps: Tensor) -> Tensor:
    """Turn (B, A, values, rows, columns) into (B, K, values)."""
    return maps.permute(0, 3, 4, 1, 2).flatten(1, 3)


def logit(score: float) -> float:
    """Return the raw prediction of a score between 0 and 1."""
    return math.log(score / (1 - score))


def require_classes(class_names: Sequence[str]) -> None:
    """Validate class names.

    Raises:
        UsageError: there are none, or one is named twice.
    """
    if not class_names or len(set(class_names)) < len(class_names):
        raise UsageError(
            "classes", expected="one or more different names", found=str(list(class_names))
        )


def _require_anchors(anchors_px: Sequence[tuple[float, float]]) -> None:
    if not anchors_px or min(min(anchor) for anchor in anchors_px) <= 0:
        raise UsageError(
            "anchors", expected="widths and heights over zero", found=str(list(anchors_px))
        )
