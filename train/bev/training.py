"""Training of the bird's-eye-view detector."""

from dataclasses import asdict
from pathlib import Path
from typing import Any, ClassVar, Literal

import torch
from lightning.pytorch import Callback, LightningModule
from lightning.pytorch.cli import LRSchedulerCallable, OptimizerCallable
from torch import Tensor
from torch.optim import AdamW

from data.samples.bev.dataset import BevDataset
from data.splits.training_frames import ENTRY, UNKNOWN
from perception.detection.bev.bev_map import BevGrid
from perception.detection.bev.boxes import BevDetections, decode_boxes, suppress
from perception.detection.bev.classes import GROUPS, SYNTHETIC_CLASSES
from train.best_epoch import Criterion, Ranking
from train.bev.images import BevImages
from train.bev.loss import BevLabels, BevLoss, BevLossConfig, bev_loss
from train.bev.metrics import CenterPrecision, FoundCenters, measure
from train.bev.networks import IDENTITY, MODEL, BevNetworkConfig, initial_network
from train.checkpoints import program_revision
from train.events import log_loss
from train.networks.bev_centers import CenterMaps
from train.optimization import WarmupCosine, configure_optimizers

Batch = dict[str, Tensor]  # what `BevDataset` says of a sample
_LOSS = BevLossConfig()


class BevTraining(LightningModule):
    """The network of the bird's-eye view, its loss, its optimizer and its metrics.

    Attributes:
        ranking: Criteria of the best epoch.
        identity: Hyperparameters that a checkpoint must share to be resumed.
    """

    ranking: ClassVar[Ranking] = (
        Criterion("validation/ap"),
        Criterion("validation/loss", is_lower_better=True),
    )
    identity: ClassVar[tuple[str, ...]] = IDENTITY

    def __init__(  # noqa: PLR0913 - the flags of a group
        self,
        *,
        modality: Literal["bev"] = "bev",
        classes: tuple[str, ...] = SYNTHETIC_CLASSES,
        reach_m: float = BevGrid.reach_m,
        cell_m: float = BevGrid.cell_m,
        weights: Path | None = None,
        loss: BevLossConfig = _LOSS,
        seed: int = 0,
        optimizer: OptimizerCallable = lambda weights: AdamW(weights, lr=0.002, weight_decay=0.02),
        lr_scheduler: LRSchedulerCallable | None = WarmupCosine,
    ) -> None:
        """Make the network with its initial weights.

        Args:
            modality: Bird's-eye view of the scan, bev.
            classes: Classes to detect: Car, Van, Truck, Bus, Trailer, Pedestrian, Cyclist, Motorcycle, Bicycle.
            reach_m: Distance in metres from the sensor to each side of the map.
            cell_m: Edge of a cell of the map in metres; a side has a multiple of 32 cells.
            weights: Checkpoint or model file whose weights to start from, of any classes; random ones without.
            loss: Weights of the terms of the loss.
            seed: Seed, which all trainings have.
            optimizer: Optimizer of the weights.
            lr_scheduler: Schedule of the learning rate.

        Raises:
            ModelError: the weights are damaged, or of another kind of network.
            UsageError: there is no such class, or the map has no whole number of cells.
        """
        super().__init__()
        self.bev = BevNetworkConfig(BevGrid(reach_m, cell_m), tuple(classes))
        """Input of the network, which the data module makes."""
        self.save_hyperparameters(
            {"model": MODEL, **self.bev.metadata, "seed": seed, "loss": asdict(loss)}
            | {"training_data": "unknown", "revision": program_revision()}
        )
        self.loss_config, self.optimizer, self.lr_scheduler = loss, optimizer, lr_scheduler
        made, stated = initial_network(self.bev, weights)
        if weights is not None:  # the data module adds the frames of this training
            self.hparams.update({ENTRY: stated.get(ENTRY, UNKNOWN)})
        self.network = made.to(memory_format=torch.channels_last)
        self.metrics: dict[str, CenterPrecision] = {}
        """Precision of each class in the last validation or test."""
        self.found = FoundCenters()

    def configure_callbacks(self) -> list[Callback]:
        """Return the callback that draws images."""
        return [BevImages()]

    def forward(self, maps: Tensor) -> CenterMaps:
        """Return raw predictions."""
        raw: CenterMaps = self.network(maps)
        return raw

    def training_step(self, batch: Batch, batch_idx: int) -> Tensor:
        """Return the loss of a batch."""
        loss = self._loss(self(batch["maps"]), batch)
        log_loss(self, "train", loss, len(batch["maps"]))
        return loss.total

    def validation_step(self, batch: Batch, batch_idx: int) -> dict[str, list[BevDetections]]:
        """Evaluate a batch; return the `detections` of each map."""
        return self._evaluate("validation", batch)

    def on_validation_epoch_end(self) -> None:
        """Log the average precision over the validation part."""
        self._log_precision("validation", self.trainer.datamodule.validation)  # type: ignore[attr-defined]

    def test_step(self, batch: Batch, batch_idx: int) -> dict[str, list[BevDetections]]:
        """Evaluate a batch."""
        return self._evaluate("test", batch)

    def on_test_epoch_end(self) -> None:
        """Log the average precision over the test part."""
        self._log_precision("test", self.trainer.datamodule.test)  # type: ignore[attr-defined]

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Store the metrics of the last validation."""
        checkpoint["precision"] = {name: asdict(one) for name, one in self.metrics.items()}

    def configure_optimizers(self) -> Any:  # noqa: ANN401 - one of many forms that Lightning takes
        """Return optimizer and schedule."""
        return configure_optimizers(self, self.network, self.optimizer, self.lr_scheduler)

    def _evaluate(self, stage: str, batch: Batch) -> dict[str, list[BevDetections]]:
        raw = self(batch["maps"])
        log_loss(self, stage, self._loss(raw, batch), len(batch["maps"]))
        scores, boxes = (part.float().cpu().numpy() for part in raw)
        groups = [GROUPS[name] for name in self.bev.class_names]
        found = [
            suppress(decode_boxes(*one, self.bev.grid), groups)
            for one in zip(scores, boxes, strict=True)
        ]
        self.found.update(found, batch["numbers"], self.global_rank)
        return {"detections": found}

    def _log_precision(self, stage: str, samples: BevDataset) -> None:
        names = self.bev.class_names
        self.metrics = measure([samples.targets(row) for row in range(len(samples))], self.found.compute(), names)  # fmt: skip
        self.found.reset()
        known = {name: one for name, one in self.metrics.items() if one.labels}
        logged = {f"{stage}/ap_{name}": 100 * one.ap for name, one in known.items()}
        for kind in ("ap", "mean_ap"):
            values = [100 * getattr(one, kind) for one in known.values()]
            logged[f"{stage}/{kind}"] = sum(values) / max(len(values), 1)
        self.log_dict(logged, sync_dist=True)

    def _loss(self, raw: CenterMaps, batch: Batch) -> BevLoss:
        labels = BevLabels(*(batch[name] for name in BevLabels._fields))
        return bev_loss(raw, labels, self.bev.grid, self.loss_config)
