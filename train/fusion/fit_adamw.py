"""The fusion's network by AdamW, batch after batch."""

from collections.abc import Iterator
from functools import partial
from math import ceil
from typing import Any

import numpy as np
import torch
from lightning.pytorch import LightningDataModule, LightningModule
from torch import Tensor
from torch.optim import AdamW
from torch.optim.lr_scheduler import LambdaLR
from torch.utils.data import DataLoader, Sampler, TensorDataset

from perception.types import Int
from train.fusion.config import FusionSets, FusionTrainingConfig
from train.fusion.mlp import RescoringMlp
from train.fusion.targets import FusionRows
from train.schedules import warmup_cosine

MONITOR = "validation/explained"


class FusionTraining(LightningModule):
    """One network and its descent by AdamW."""

    def __init__(self, config: FusionTrainingConfig, network: RescoringMlp) -> None:
        """Take a network as it is."""
        super().__init__()
        self.save_hyperparameters(config.hyper_parameters)
        self.config, self.network = config, network

    def training_step(self, batch: list[Tensor], batch_idx: int) -> Tensor:
        """Return the error of a batch."""
        features, targets, weights = batch
        squares = weights * (self.network(features) - targets) ** 2
        error: Tensor = squares.sum() / weights.sum().clamp(min=1e-6)
        self.log("train/mse", error, on_step=False, on_epoch=True, batch_size=len(features))
        return error

    def validation_step(self, batch: list[Tensor], batch_idx: int) -> None:
        """Log the error of the whole set, and which share of the targets' variance is explained."""
        features, targets, weights = batch
        total = weights.sum()
        error = (weights * (self.network(features) - targets) ** 2).sum() / total
        mean = (weights * targets).sum() / total
        variance = (weights * (targets - mean) ** 2).sum() / total
        found = {"validation/mse": error, MONITOR: 1 - error / variance.clamp(min=1e-12)}
        self.log_dict(found, batch_size=len(features))

    def configure_optimizers(self) -> Any:  # noqa: ANN401 - one of many forms that Lightning takes
        """Return the descent and its rate, which changes with every step."""
        weights = [w for w in self.parameters() if w.ndim > 1]
        biases = [w for w in self.parameters() if w.ndim <= 1]
        groups = [
            {"params": weights, "weight_decay": self.config.weight_decay},
            {"params": biases, "weight_decay": 0.0},
        ]
        optimizer = AdamW(groups, lr=self.config.learning_rate)
        steps = int(self.trainer.estimated_stepping_batches)
        rate = LambdaLR(optimizer, partial(warmup_cosine, steps=steps))
        return {"optimizer": optimizer, "lr_scheduler": {"scheduler": rate, "interval": "step"}}


class ShuffledRows(Sampler[Int]):
    """All rows, a batch at once, in an order of the seed and the epoch: so going on changes nothing."""

    def __init__(self, count: int, batch: int, seed: int) -> None:
        self._count, self._batch, self._seed, self._epoch = count, batch, seed, 0

    def __len__(self) -> int:
        """Return how many batches there are."""
        return ceil(self._count / self._batch)

    def __iter__(self) -> Iterator[Int]:
        """Yield the rows of each batch of this epoch."""
        order = np.random.default_rng((self._seed, self._epoch)).permutation(self._count)
        for start in range(0, self._count, self._batch):
            yield order[start : start + self._batch]

    def set_epoch(self, epoch: int) -> None:
        """Say which epoch is next, as Lightning does."""
        self._epoch = epoch


class FusionBatches(LightningDataModule):
    """Combinations in batches; what was kept back is one."""

    def __init__(self, sets: FusionSets, config: FusionTrainingConfig) -> None:
        super().__init__()
        self._sets, self._plan = sets, config

    def train_dataloader(self) -> DataLoader[Any]:
        """Return what is learned from, in a new order each time."""
        order = ShuffledRows(len(self._sets.training), self._plan.batch, self._plan.seed)
        return DataLoader(_tensors(self._sets.training), batch_size=None, sampler=order)

    def val_dataloader(self) -> DataLoader[Any]:
        """Return what was kept back."""
        rows = _tensors(self._sets.validation)
        return DataLoader(rows, batch_size=None, sampler=[np.arange(len(rows))])


def _tensors(rows: FusionRows) -> TensorDataset:
    return TensorDataset(*(torch.from_numpy(column) for column in vars(rows).values()))
