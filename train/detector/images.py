"""TensorBoard images of a detector: validation images with boxes, and precision-recall curves."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from lightning.pytorch import LightningModule, Trainer
from torch import Tensor

from perception.evaluation.detection.average_precision import DetectionMetrics
from perception.render import palette
from perception.render.curve_plots import CurvePanel, curve_figure, precision_panel
from perception.render.detections import draw_boxes
from perception.render.labels import Label, draw_labels
from perception.types import Detections, Float64, UInt8
from train.events import tensorboard_loggers
from train.validation_images import ValidationImages

Batch = dict[str, Tensor]
_DISPLAY_SCORE = 0.3  # lower ones would hide the image
_SMALLEST_WIDTH_PX = 1200  # smaller images are enlarged
_LABEL, _IGNORED, _FOUND = palette.MOVING, palette.POINTS, (255, 255, 255)
_TEXT_PX = 10


class DetectorImages(ValidationImages):
    """Draw some images and the curves of every validation."""

    name, count, axis = "validation/images", 6, 0

    def on_validation_batch_end(
        self,
        trainer: Trainer,
        pl_module: LightningModule,
        outputs: Mapping[str, Sequence[Detections]],  # type: ignore[override]
        batch: Batch,
        batch_idx: int,
        dataloader_idx: int = 0,
    ) -> None:
        """Draw the chosen images of a batch."""
        for position, row in enumerate(batch["numbers"].tolist()):
            if row in self._rows:
                self._drawn[row] = draw_detections(batch, position, outputs["detections"][position])

    def on_validation_epoch_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Log the images below each other, and the curves."""
        super().on_validation_epoch_end(trainer, pl_module)
        metrics: Any = pl_module.metrics
        for logger in tensorboard_loggers(trainer):
            if metrics is not None:
                figure = curve_figure("validation", curve_panels(metrics))
                logger.experiment.add_figure("validation/curves", figure, trainer.global_step)


def draw_detections(batch: Batch, position: int, found: Detections) -> UInt8:
    """Return the (H, W, 3) drawing of one image: labels green, ignored grey, detections white with scores.

    It is an integer factor larger than the input.
    """
    planes = batch["images"][position].byte().cpu().numpy()
    times = -(-_SMALLEST_WIDTH_PX // planes.shape[2])
    large = planes.repeat(times, axis=1).repeat(times, axis=2)
    colored = np.broadcast_to(large, (3, *large.shape[1:]))
    canvas = np.ascontiguousarray(colored.transpose(1, 2, 0))
    boxes_px: Float64 = times * batch["boxes_px"][position].cpu().numpy().astype(np.float64)
    has_area = (boxes_px[:, 2:] > boxes_px[:, :2]).all(axis=1)
    is_ignored = batch["is_ignored"][position].cpu().numpy().astype(bool)
    draw_boxes(canvas, boxes_px[has_area & is_ignored], _IGNORED)
    draw_boxes(canvas, boxes_px[has_area & ~is_ignored], _LABEL)
    sure = found[found.scores >= _DISPLAY_SCORE]
    draw_boxes(canvas, times * sure.boxes_px, _FOUND)
    scored = zip(times * sure.boxes_px, sure.scores.tolist(), strict=True)
    labels = [Label(box_px, f"{100 * score:.0f}%", _FOUND) for box_px, score in scored]
    draw_labels(canvas, labels, _TEXT_PX)
    return canvas


def curve_panels(validation_metrics: DetectionMetrics) -> list[CurvePanel]:
    """Return a panel for each class and IoU, with a curve for each difficulty."""
    return [
        precision_panel(
            f"{of_class.name}, IoU {of_class.iou:g}",
            {f"{name}: {curve.ap():.1f} %": curve.precision for name, curve in curves.items()},
            "AP",
        )
        for of_class, curves in validation_metrics.items()
    ]
