"""Candidates that a network tells apart in seconds: a bright block in half of the pictures."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from lightning.pytorch import LightningDataModule
from torch.utils.data import DataLoader, Sampler

from data.samples.epoch_samplers import DistributedBatchSampler
from train.checkpoints import read_checkpoint
from train.networks.depthcn import MODEL
from train.verifier.kind import DEPTHCN


def toy_batch(count: int, channels: int, seed: int = 0) -> dict[str, torch.Tensor]:
    random = np.random.default_rng(seed)
    crops = random.integers(20, 60, (count, channels, 66, 112), dtype=np.uint8)
    is_vehicle = np.arange(count) % 2 == 0
    boxes = np.full((count, 4), np.nan, np.float32)
    for row in np.flatnonzero(is_vehicle):
        left, top = int(random.integers(20, 45)), int(random.integers(15, 30))
        right, bottom = left + int(random.integers(30, 50)), top + int(random.integers(20, 30))
        crops[row, :, top:bottom, left:right] = 200
        boxes[row] = left / 112, top / 66, right / 112, bottom / 66
    windows = np.tile(np.array([100, 50, 324, 182], np.float32), (count, 1))
    return {
        "crops": torch.from_numpy(crops),
        "windows_px": torch.from_numpy(windows),
        "is_vehicle": torch.from_numpy(is_vehicle),
        "normalized_box": torch.from_numpy(boxes),
    }


class _Order(Sampler[int]):
    def __init__(self, count: int, epoch: int) -> None:
        self._count, self._epoch = count, epoch

    def set_epoch(self, epoch: int) -> None:
        self._epoch = epoch

    def __iter__(self) -> Iterator[int]:
        return iter(np.random.default_rng(self._epoch).permutation(self._count).tolist())

    def __len__(self) -> int:
        return self._count


@dataclass(frozen=True)
class ToyResult:
    """What a training leaves."""

    checkpoint: Path
    epoch: int


def toy_report(module: object, data: object, stage: str, checkpoint: Path) -> ToyResult:
    return ToyResult(checkpoint, read_checkpoint(checkpoint, MODEL)["epoch"])


class ToyCrops(LightningDataModule):
    training_data = "toys"
    augmentation = None

    def __init__(self, count: int = 32, channels: int = 3, batch: int = 8, seed: int = 0) -> None:
        super().__init__()
        self._count, self._channels, self._batch = count, channels, batch

    def _rows(self, seed: int) -> list[dict[str, torch.Tensor]]:
        whole = toy_batch(self._count, self._channels, seed)
        return [{name: value[row] for name, value in whole.items()} for row in range(self._count)]

    def train_dataloader(self) -> DataLoader:
        epoch = self.trainer.current_epoch if self.trainer else 0
        order = _Order(self._count, epoch)
        process = self.trainer.global_rank if self.trainer else 0
        processes = self.trainer.world_size if self.trainer else 1
        share = DistributedBatchSampler(order, self._batch, process, processes)
        return DataLoader(self._rows(0), batch_size=self._batch, sampler=share)

    def mean_crop(self) -> torch.Tensor:
        return toy_batch(self._count, self._channels)["crops"].float().mean(0)

    def val_dataloader(self) -> DataLoader:
        return DataLoader(self._rows(1), batch_size=self._batch)


TOY_DEPTHCN = replace(DEPTHCN, data=ToyCrops, links={}, report=toy_report)
