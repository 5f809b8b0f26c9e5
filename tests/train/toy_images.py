"""Pictures that a detector learns in seconds: bright blocks on dark ground, at a quarter of their taken size."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import torch
from lightning.pytorch import LightningDataModule
from torch import nn
from torch.utils.data import DataLoader, Sampler

from data.samples.epoch_samplers import DistributedBatchSampler
from data.samples.images.dataset import collate
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.network_input import ImagePlacement, PixelRectangle, place
from perception.evaluation.detection.box_rows import TrueBoxes
from perception.evaluation.detection.protocol import NO_ALPHA_RAD
from train.detector.kind import DETECTOR
from train.networks.compact import CompactDetector

SIZE = InputSize(64, 96)
SCALE = 4  # of the pictures as they were taken
CARS = 4


def tiny_network(class_names: tuple[str, ...], channels: int) -> CompactDetector:
    return CompactDetector(
        class_names, channels=channels, widths=(8, 16, 24, 24, 24), residuals=(0, 0, 0)
    )


def tiny_network_without_batch_norm(class_names: tuple[str, ...], channels: int) -> CompactDetector:
    """Batch norm measures the images of one process, so that its share of a batch is not the whole one."""
    network = tiny_network(class_names, channels)
    for part in list(network.modules()):
        for name, child in part.named_children():
            if isinstance(child, nn.BatchNorm2d):
                setattr(part, name, nn.GroupNorm(1, child.num_features))
    return network


class ToySamples:
    """Four cars in every picture, one in each quarter of it."""

    def __init__(self, count: int, seed: int, channels: int = 1) -> None:
        random = np.random.default_rng(seed)
        shape = (count, channels, *SIZE)
        self.images = random.integers(20, 60, shape, dtype=np.uint8)
        self.boxes_px = np.zeros((count, CARS, 4), np.float32)
        for row in range(count):
            for car in range(CARS):
                left = 48 * (car % 2) + random.integers(2, 14)
                top = 32 * (car // 2) + random.integers(2, 14)
                right, bottom = left + random.integers(16, 28), top + random.integers(14, 18)
                self.boxes_px[row, car] = left, top, right, bottom
                self.images[row, :, top:bottom, left:right] = 200

    def __len__(self) -> int:
        return len(self.images)

    def __getitem__(self, row: int) -> dict[str, torch.Tensor]:
        return {
            "images": torch.from_numpy(self.images[row]),
            "boxes_px": torch.from_numpy(self.boxes_px[row]),
            "classes": torch.zeros(CARS, dtype=torch.int64),
            "is_ignored": torch.zeros(CARS, dtype=torch.bool),
            "numbers": torch.tensor(row),
        }

    def target_types(self) -> Counter[str]:
        return Counter(Car=CARS * len(self))

    def label_sizes_px(self) -> np.ndarray:
        boxes_px = self.boxes_px.reshape(-1, 4).astype(np.float64)
        return boxes_px[:, 2:] - boxes_px[:, :2]

    def placement(self, row: int) -> ImagePlacement:
        return place(PixelRectangle(0, 0, SCALE * SIZE.width_px, SCALE * SIZE.height_px), SIZE)

    def truth(self) -> TrueBoxes:
        count = CARS * len(self)
        return TrueBoxes(
            frames=np.repeat(np.arange(len(self)), CARS),
            types=np.full(count, "Car"),
            alphas_rad=np.full(count, NO_ALPHA_RAD),
            boxes_px=SCALE * self.boxes_px.reshape(-1, 4).astype(np.float64),
            truncation=np.zeros(count),
            occlusion=np.zeros(count),
        )


class _Order(Sampler[int]):
    """A new order at every epoch, or several times the same."""

    def __init__(self, count: int, epoch: int, repeats: int | None) -> None:
        self._count, self._epoch, self._repeats = count, epoch, repeats

    def set_epoch(self, epoch: int) -> None:
        self._epoch = epoch

    def __iter__(self) -> Iterator[int]:
        if self._repeats:
            return iter(list(range(self._count)) * self._repeats)
        return iter(np.random.default_rng(self._epoch).permutation(self._count).tolist())

    def __len__(self) -> int:
        return self._count * (self._repeats or 1)


class ToyImages(LightningDataModule):
    """To learn from and to judge by; or one batch over and over, judged by itself."""

    training_data = "toys"

    def __init__(
        self,
        count: int = 8,
        batch: int = 4,
        channels: int = 1,
        repeats: int | None = None,
        seed: int = 0,
    ) -> None:
        super().__init__()
        self.training = ToySamples(count, 0, channels)
        self.validation = self.training if repeats else ToySamples(5, 1, channels)
        self._batch, self._repeats = count if repeats else batch, repeats

    def train_dataloader(self) -> DataLoader:
        order = _Order(len(self.training), self.trainer.current_epoch, self._repeats)
        share = DistributedBatchSampler(
            order, self._batch, self.trainer.global_rank, self.trainer.world_size
        )
        return DataLoader(self.training, self._batch, sampler=share, collate_fn=collate)

    def val_dataloader(self) -> DataLoader:
        return DataLoader(self.validation, batch_size=2, collate_fn=collate)


TOY_DETECTOR = replace(DETECTOR, data=ToyImages, links={})
# A small network that learns in seconds; the test offers it as `tiny`.
TINY = (
    "--model.modality=dm",
    "--model.network=tiny",
    f"--model.size={SIZE.height_px}x{SIZE.width_px}",
    "--model.scales=[0.5,1.0]",
    "--optimizer.lr=0.01",
    "--ema.decay=0.8",
    "--trainer.precision=32-true",
)
