"""AdamW of the fusion's network, in batches."""

from collections.abc import Iterator
from math import ceil
from typing import Any

import numpy as np
import torch
from lightning.pytorch import LightningDataModule, LightningModule
from torch import Tensor
from torch.utils.data import DataLoader, Sampler, TensorDataset

from perception.types import Int
from train.fusion.config import FusionTrainingConfig
from train.fusion.mlp import RescoringMlp
from train.fusion.previous import configure_optimizers
from train.fusion.targets import FusionRows, FusionSets


class FusionTraining(LightningModule):
    """The fusion's network and its training by AdamW."""

    def __init__(self, config: FusionTrainingConfig, network: RescoringMlp) -> None:
        """Take a network with its initial weights."""
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
        """Log the error of the whole set."""
        features, targets, weights = batch
        error = (weights * (self.network(features) - targets) ** 2).sum() / weights.sum()
        self.log("validation/mse", error, batch_size=len(features))

    def configure_optimizers(self) -> Any:  # noqa: ANN401 - one of many forms that Lightning takes
        """Return optimizer and schedule."""
        return configure_optimizers(self, self.network, self.config.adamw)


class ShuffledRows(Sampler[Int]):
    """Batches of all rows, in an order that depends on seed and epoch alone."""

    def __init__(self, count: int, batch: int, seed: int) -> None:
        self._count, self._batch, self._seed, self._epoch = count, batch, seed, 0

    def __len__(self) -> int:
        """Return the number of batches."""
        return ceil(self._count / self._batch)

    def __iter__(self) -> Iterator[Int]:
        """Yield the rows of each batch of this epoch."""
        order = np.random.default_rng((self._seed, self._epoch)).permutation(self._count)
        for start in range(0, self._count, self._batch):
            yield order[start : start + self._batch]

    def set_epoch(self, epoch: int) -> None:
        """Set the next epoch; called by Lightning."""
        self._epoch = epoch


class FusionBatches(LightningDataModule):
    """Combinations in batches; all validation rows are one batch."""

    def __init__(self, sets: FusionSets, config: FusionTrainingConfig) -> None:
        super().__init__()
        self._sets, self._config = sets, config

    def train_dataloader(self) -> DataLoader[Any]:
        """Return training batches, in a new order at every epoch."""
        order = ShuffledRows(len(self._sets.training), self._config.batch_size, self._config.seed)
        return DataLoader(_tensors(self._sets.training), batch_size=None, sampler=order)

    def val_dataloader(self) -> DataLoader[Any]:
        """Return the validation batch."""
        rows = _tensors(self._sets.validation)
        return DataLoader(rows, batch_size=None, sampler=[np.arange(len(rows))])


def _tensors(rows: FusionRows) -> TensorDataset:
    return TensorDataset(*(torch.from_numpy(column) for column in vars(rows).values()))
