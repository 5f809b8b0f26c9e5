"""Crops of drives on disk, in batches, for Lightning."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from data.array_store import ArrayStore
from data.samples.config import TrainingDrives
from data.samples.crops.config import CropDataConfig
from data.samples.crops.dataset import CropDataset
from data.samples.crops.labelled_frames import CropConfig, LabelledFrames
from data.samples.crops.sampling import CropSet, collect_crops
from data.samples.datamodule import SampleDataModule
from data.samples.epoch_samplers import BalancedSampler
from perception.types import Drive, Progress

_CROP = CropConfig()


class CropDataModule(SampleDataModule[LabelledFrames, CropDataset]):
    """Batches of crops: augmented and balanced for training, unchanged proposals for validation.

    A batch holds what `CropDataset` says of a sample, with a first axis of samples.
    """

    config: CropDataConfig

    def __init__(
        self,
        drives: Sequence[Path] = (),
        validation: Sequence[Path] = (),
        *,
        split: Path | None = None,
        crop: CropConfig = _CROP,
        seed: int = 0,
        **config: Any,  # noqa: ANN401 - jsonargparse reads the fields from the class
    ) -> None:
        """Take what `setup` needs; nothing is read yet.

        Args:
            drives: Labelled drives of any layout; of a folder of several, all are taken.
            validation: Labelled drives for validation; else a fraction of the frames is kept back.
            split: File of `trifuse split`, which names the frames of each part, and drives where none are given.
            crop: Input of the network.
            seed: Seed of split, jitter, order and augmentation.
            config: Fields of `CropDataConfig`.
        """
        sources = TrainingDrives(tuple(drives), tuple(validation), split)
        super().__init__(sources, CropDataConfig(**config), seed)
        self.crop = crop

    def mean_crop(self, samples: int = 1024) -> Tensor:
        """Return the (C, 66, 112) mean of some unchanged training samples, half of them vehicles."""
        plain = CropDataset(self.training.frames, self.training.crops, None, self.seed)
        sampler = BalancedSampler(plain.crops.is_vehicle, self.seed, samples)
        total = sum(plain[index]["crops"].to(torch.int64) for index in sampler)
        return torch.as_tensor(total, dtype=torch.float32) / len(sampler)

    def _open_frames(self, drives: Sequence[Drive], store: ArrayStore) -> LabelledFrames:
        return LabelledFrames(drives, self.crop, store)

    def _fill_cache(self, frames: LabelledFrames) -> None:
        self._collect(frames, self.progress)

    def _make_dataset(self, frames: LabelledFrames, *, is_training: bool) -> CropDataset:
        crops = self._collect(frames)
        if is_training:
            return CropDataset(frames, crops, self.augmentation, self.seed)
        # Evaluation is on proposals, which the network will meet, not on jittered labels.
        return CropDataset(frames, crops[~crops.is_jittered], None, self.seed)

    def _require_labels(self) -> None:
        self.training.crops.require_both_classes("training crops")
        self.validation.crops.require_both_classes("validation crops")

    def _epoch_sampler(self) -> BalancedSampler:
        is_vehicle = self.training.crops.is_vehicle
        return BalancedSampler(is_vehicle, self.seed, self.config.samples_per_epoch)

    def _collect(self, frames: LabelledFrames, progress: Progress = iter) -> CropSet:
        config = self.config
        return collect_crops(
            frames,
            config.sampling,
            on_bad_frame=config.on_bad_frame,
            seed=self.seed,
            progress=progress,
        )
