"""TensorBoard images of a verifier: augmented crops, worst errors, and predicted boxes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import torch
from lightning.pytorch import Callback, LightningModule, Trainer
from torch import Tensor
from torch.nn import functional

from perception.types import Float32, UInt8
from train.events import tensorboard_loggers

Batch = dict[str, Tensor]

_LABEL, _FOUND, _WRONG = (90, 220, 90), (255, 255, 255), (255, 80, 80)  # RGB
_COLUMNS, _ROWS = 8, 4
_COUNT = _COLUMNS * _ROWS


@dataclass(frozen=True)
class ScoredCrops:
    """M crops with the output of a verifier.

    Attributes:
        crops: (M, C, H, W) uint8 crops.
        logits: (M,) logits of a vehicle.
        shares: (M, 4) predicted boxes, 0..1 over the crop.
        is_vehicle: (M,) mask of the vehicles.
        normalized_box: (M, 4) boxes of the labels, 0..1 over the crop, NaN where there is none.
    """

    crops: Tensor
    logits: Tensor
    shares: Tensor
    is_vehicle: Tensor
    normalized_box: Tensor

    @property
    def losses(self) -> Tensor:
        """(M,) cross-entropy of each; above log 2 it is misclassified."""
        return functional.binary_cross_entropy_with_logits(
            self.logits, self.is_vehicle.float(), reduction="none"
        )

    def __getitem__(self, rows: Tensor | slice) -> "ScoredCrops":
        """Return some of them."""
        return ScoredCrops(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def __add__(self, others: "ScoredCrops") -> "ScoredCrops":
        """Return these and others."""
        names = self.__dataclass_fields__
        return ScoredCrops(*(torch.cat([getattr(c, n) for c in (self, others)]) for n in names))


class VerifierImages(Callback):
    """Draw augmentations once, and worst errors and boxes of every validation."""

    def __init__(self, augmentations: Callable[[], Mapping[str, UInt8]] = dict) -> None:
        """Take the source of the images at the start.

        Args:
            augmentations: Function that returns (H, W, 3) RGB images by name, called once the data is loaded.
        """
        self._augmentations = augmentations
        self._mistakes: ScoredCrops | None = None
        self._vehicles: ScoredCrops | None = None

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Show what each augmentation does, where a training begins."""
        if trainer.current_epoch == 0 and tensorboard_loggers(trainer):
            for name, image in self._augmentations().items():
                _show(trainer, f"augmentation/{name}", image)

    def on_validation_epoch_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Forget the last validation."""
        self._mistakes = self._vehicles = None

    def on_validation_batch_end(
        self,
        trainer: Trainer,
        pl_module: LightningModule,
        outputs: Batch,  # type: ignore[override]
        batch: Batch,
        batch_idx: int,
        dataloader_idx: int = 0,
    ) -> None:
        """Keep the worst so far, and the first vehicles."""
        if not tensorboard_loggers(trainer):
            return
        names = ("crops", "is_vehicle", "normalized_box")
        known = {name: value.detach().cpu() for name, value in (batch | outputs).items()}
        scored = ScoredCrops(
            logits=known["logits"].float(),
            shares=known["shares"].float(),
            **{name: known[name] for name in names},
        )
        wrong = scored[scored.losses > np.log(2)]
        mistakes = wrong if self._mistakes is None else self._mistakes + wrong
        self._mistakes = mistakes[mistakes.losses.argsort(descending=True, stable=True)[:_COUNT]]
        if self._vehicles is None or len(self._vehicles.logits) < _COUNT:
            vehicles = scored[scored.is_vehicle.bool()]
            self._vehicles = vehicles if self._vehicles is None else self._vehicles + vehicles

    def on_validation_epoch_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Show both."""
        for name, scored in (("worst errors", self._mistakes), ("boxes", self._vehicles)):
            if scored is not None and len(scored.logits):
                _show(trainer, f"validation/{name}", draw_scored(scored[:_COUNT]))


def draw_scored(scored: ScoredCrops) -> UInt8:
    """Return an RGB grid: each crop with its score, the label's box green, the found one white."""
    scores = scored.logits.sigmoid().tolist()
    tiles = [
        _tile(crop, score, bool(is_vehicle), np.stack([found, label]))
        for crop, score, is_vehicle, found, label in zip(
            scored.crops.numpy(),
            scores,
            scored.is_vehicle.tolist(),
            scored.shares.numpy(),
            scored.normalized_box.numpy(),
            strict=True,
        )
    ]
    return _grid(tiles)


def _tile(crop: UInt8, score: float, is_vehicle: bool, boxes: Float32) -> UInt8:
    """Draw depth, near bright, at twice its size."""
    gray = np.where(crop[0] > 0, 255 - crop[0] // 2, 0).astype(np.uint8)
    large = cv2.resize(gray, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    tile = np.repeat(large[..., None], 3, axis=2)
    size = np.array((large.shape[1], large.shape[0]) * 2)
    for box, color in zip(boxes, (_FOUND, _LABEL), strict=True):
        if is_vehicle and np.isfinite(box).all():
            x1, y1, x2, y2 = (np.clip(box, -1, 2) * size).astype(int).tolist()
            cv2.rectangle(tile, (x1, y1), (x2, y2), color, 1)
    color = _FOUND if (score > 0.5) == is_vehicle else _WRONG
    text = f"{'vehicle' if is_vehicle else 'other'} {score:.2f}"
    cv2.putText(tile, text, (3, 12), cv2.FONT_HERSHEY_SIMPLEX, 0.4, color, 1, cv2.LINE_AA)
    return np.asarray(tile, np.uint8)


def _grid(tiles: Sequence[UInt8]) -> UInt8:
    height, width = tiles[0].shape[:2]
    rows = -(-len(tiles) // _COLUMNS)
    columns = min(len(tiles), _COLUMNS)
    image = np.zeros((rows * (height + 2), columns * (width + 2), 3), np.uint8)
    for number, tile in enumerate(tiles):
        row, column = divmod(number, _COLUMNS)
        top, left = row * (height + 2), column * (width + 2)
        image[top : top + height, left : left + width] = tile
    return image


def _show(trainer: Trainer, name: str, image: UInt8) -> None:
    for logger in tensorboard_loggers(trainer):
        logger.experiment.add_image(name, image, trainer.global_step, dataformats="HWC")
