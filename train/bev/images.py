"""TensorBoard images of the bird's-eye view: validation scans from above with labels and detections."""

from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from lightning.pytorch import LightningModule, Trainer
from torch import Tensor

from perception.detection.bev.bev_map import FREE, HIDDEN, TOP, planes_of
from perception.detection.bev.boxes import BevDetections
from perception.geometry.boxes import corners
from perception.render import palette
from perception.types import Boxes3D, UInt8
from train.validation_images import ValidationImages

Batch = dict[str, Tensor]
_DISPLAY_SCORE = 0.3  # lower ones would hide the map
_LABEL, _IGNORED, _FOUND = palette.MOVING, palette.POINTS, (255, 255, 255)


class BevImages(ValidationImages):
    """Draw some scans of every validation, the same in every epoch."""

    name, count, axis = "validation/maps", 4, 1

    def on_validation_batch_end(
        self,
        trainer: Trainer,
        pl_module: LightningModule,
        outputs: Mapping[str, Sequence[BevDetections]],  # type: ignore[override]
        batch: Batch,
        batch_idx: int,
        dataloader_idx: int = 0,
    ) -> None:
        """Draw the chosen scans of a batch."""
        network: Any = pl_module
        reach_m: float = network.bev.grid.reach_m
        for place, row in enumerate(batch["numbers"].tolist()):
            if row in self._rows:
                self._drawn[row] = draw_map(batch, place, outputs["detections"][place], reach_m)


def draw_map(batch: Batch, place: int, found: BevDetections, reach_m: float) -> UInt8:
    """Return the (R, R, 3) drawing of one scan, x up and y to the left.

    Returns are grey by height, passed cells dark, hidden ones red; labels green, ignored ones grey, detections white.
    """
    planes = planes_of(batch["maps"][place].cpu().numpy())
    canvas = np.repeat(np.maximum(planes[TOP], planes[FREE] // 8)[..., None], 3, axis=2)
    canvas[..., 0] = np.maximum(canvas[..., 0], planes[HIDDEN] // 4)
    canvas = np.ascontiguousarray(canvas[::-1, ::-1])
    boxes, is_ignored = (
        batch["boxes"][place].cpu().numpy(),
        batch["is_ignored"][place].cpu().numpy(),
    )
    has_size = boxes[:, 3] > 0
    for mask, color in ((is_ignored, _IGNORED), (~is_ignored, _LABEL)):
        rows = boxes[has_size & mask].astype(np.float64)
        _draw(canvas, Boxes3D(rows[:, :3], rows[:, 3:6], rows[:, 6]), color, reach_m)
    _draw(canvas, found[found.scores >= _DISPLAY_SCORE].boxes, _FOUND, reach_m)
    return canvas


def _draw(canvas: UInt8, boxes: Boxes3D, color: tuple[int, int, int], reach_m: float) -> None:
    """Draw outlines, with a line from the middle to the front."""
    side = len(canvas)
    around = corners(boxes)[:, [0, 1, 2, 3, 0], :2]
    fronts = (around[:, 0] + around[:, 3]) / 2
    for outline, middle, front in zip(around, boxes.bottom_m[:, :2], fronts, strict=True):
        for line in (outline, np.stack([middle, front])):
            pixels = (reach_m - line[:, ::-1]) * side / (2 * reach_m)
            cv2.polylines(canvas, [pixels.round().astype(np.int32)], isClosed=False, color=color)
