"""Combinations of detections in labelled drives, in batches, for Lightning."""

from collections.abc import Iterator, Sequence
from functools import cached_property
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
import torch
from lightning.pytorch import LightningDataModule
from torch.utils.data import DataLoader, Sampler, TensorDataset

from data.detections.split_detections import SplitDetections, split_detections
from data.samples.config import TrainingDrives
from perception.detection.config import FusionVariant
from perception.types import Int, Progress
from train.fusion.config import FusionRowsConfig
from train.fusion.targets import FusionRows, fusion_rows


class RowBatches(Sampler[Int]):
    """Batches of all rows, in an order that depends on seed and epoch alone; each process takes a part of each."""

    def __init__(
        self, count: int, batch_size: int, seed: int = 0, process: int = 0, processes: int = 1
    ) -> None:
        """Take the number of rows.

        Args:
            count: Number of rows.
            batch_size: Rows per batch, of all processes together.
            seed: Seed of the order.
            process: Rank of the process, from 0.
            processes: Number of processes.
        """
        self._count, self._batch_size, self._seed = count, batch_size, seed
        self._part = slice(process, None, processes)
        self._epoch = 0

    def __len__(self) -> int:
        """Return the number of batches."""
        return ceil(self._count / self._batch_size)

    def __iter__(self) -> Iterator[Int]:
        """Yield the rows of each batch of this epoch."""
        order = np.random.default_rng((self._seed, self._epoch)).permutation(self._count)
        for start in range(0, self._count, self._batch_size):
            yield order[start : start + self._batch_size][self._part]

    def set_epoch(self, epoch: int) -> None:
        """Set the next epoch; called by Lightning."""
        self._epoch = epoch


class FusionDataModule(LightningDataModule):
    """Rows of combinations: batches for training; for validation and test one batch, the same in every process.

    Attributes:
        config: Split, cache, detectors and batches.
        progress: Wrapper of the loop over frames that may show its progress.
    """

    config: FusionRowsConfig
    progress: Progress = iter

    def __init__(
        self,
        drives: Sequence[Path] = (),
        validation: Sequence[Path] = (),
        split: Path | None = None,
        variant: FusionVariant = "default",
        max_partners: int | None = None,
        seed: int = 0,
        **config: Any,  # noqa: ANN401 - fields of the configuration
    ) -> None:
        """Take what is read later.

        Args:
            drives: Labelled drives of any layout; of a folder of several, all are taken. Frames that a detector was
                trained on are left out.
            validation: Labelled drives for validation and test; else a part of the frames is kept back.
            split: Split file of `trifuse split`, whose test part is the test; else a split is drawn.
            variant: Features of a combination.
            max_partners: Maximum number of boxes of each other modality that a box is combined with, 0 for all;
                else that of the variant.
            seed: Seed of the split and of the order.
            config: Fields of `FusionRowsConfig`.
        """
        super().__init__()
        self.drives = TrainingDrives(tuple(drives), tuple(validation), split)
        self.config = FusionRowsConfig(**config)
        self.variant, self.max_partners, self.seed = variant, max_partners, seed

    @property
    def training_data(self) -> str:
        """Names of the training drives."""
        return self.drives.names

    @cached_property
    def detections(self) -> SplitDetections:
        """Detections in the frames of each part.

        Raises:
            UsageError: the detectors were trained on all frames, or nothing is left of a part.
            PerceptionError: a drive, a frame or a model cannot be read or used.
        """
        return split_detections(
            self.drives, self.config.models, self.config, self.seed, self.progress
        )

    @cached_property
    def training(self) -> FusionRows:
        """Rows that the network is fitted to."""
        copies = self.config.corrupted_copies
        return fusion_rows(self.detections.training, self.variant, self.max_partners, copies)

    @cached_property
    def validation(self) -> FusionRows:
        """Rows that decide which epoch is the best, and when to stop."""
        return fusion_rows(self.detections.validation, self.variant, self.max_partners)

    @cached_property
    def test(self) -> FusionRows:
        """Rows of the final test."""
        return fusion_rows(self.detections.test, self.variant, self.max_partners)

    def prepare_data(self) -> None:
        """Detect in all frames; the other processes read the cache."""
        self.detections  # noqa: B018 - it is kept

    def train_dataloader(self) -> DataLoader[Any]:
        """Return training batches, in a new order at every epoch."""
        count, trainer = len(self.training), self.trainer
        ranks = (0, 1) if trainer is None else (trainer.global_rank, trainer.world_size)
        return _loader(
            self.training, RowBatches(count, self.config.batch_size or count, self.seed, *ranks)
        )

    def val_dataloader(self) -> DataLoader[Any]:
        """Return the validation rows as one batch."""
        return _loader(self.validation)

    def test_dataloader(self) -> DataLoader[Any]:
        """Return the test rows as one batch."""
        return _loader(self.test)


def row_tensors(rows: FusionRows) -> tuple[torch.Tensor, ...]:
    """Return features, targets and weights as tensors."""
    return tuple(torch.from_numpy(column) for column in vars(rows).values())


def _loader(rows: FusionRows, batches: Sampler[Int] | None = None) -> DataLoader[Any]:
    """Return the rows of each batch; of all where no batches are named."""
    whole = [np.arange(len(rows))]
    sampler = whole if batches is None else batches
    return DataLoader(TensorDataset(*row_tensors(rows)), batch_size=None, sampler=sampler)
