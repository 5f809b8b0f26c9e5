"""TensorBoard images of a detector: validation images with boxes, and precision-recall curves."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from lightning.pytorch import Callback, LightningModule, Trainer
from torch import Tensor

from perception.evaluation.detection.average_precision import DetectionMetrics
from perception.render import palette
from perception.render.curve_plots import CurvePanel, curve_figure, precision_panel
from perception.render.detections import draw_boxes
from perception.render.labels import Label, draw_labels
from perception.types import Detections, Float64, UInt8
from train.events import tensorboard_loggers

Batch = dict[str, Tensor]
_SHOWN_IMAGES = 6
_DISPLAY_SCORE = 0.3  # lower ones would hide the image
_SMALLEST_WIDTH_PX = 1200  # smaller images are enlarged
_LABEL, _IGNORED, _FOUND = palette.MOVING, palette.POINTS, (255, 255, 255)
_TEXT_PX = 10


class DetectorImages(Callback):
    """Draw some images and the curves of every validation."""

    def __init__(self) -> None:
        self._rows: frozenset[int] = frozenset()
        self._drawn: dict[int, UInt8] = {}

    def on_validation_epoch_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Choose the images: spread evenly, the same in every epoch."""
        count = len(trainer.datamodule.validation)  # type: ignore[attr-defined]
        rows = np.linspace(0, count - 1, min(count, _SHOWN_IMAGES)).round().astype(int)
        is_shown = bool(tensorboard_loggers(trainer))
        self._rows, self._drawn = frozenset(rows.tolist() if is_shown else ()), {}

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
        for logger in tensorboard_loggers(trainer):
            if self._drawn:
                image = np.concatenate([self._drawn[row] for row in sorted(self._drawn)])
                logger.experiment.add_image(
                    "validation/images", image, trainer.global_step, dataformats="HWC"
                )
            metrics: Any = pl_module.metrics
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
