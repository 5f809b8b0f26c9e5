"""The base of Lightning data modules over labelled drives: caching, the split, and batches."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

import cv2
import numpy as np
from lightning.pytorch import LightningDataModule
from torch.utils.data import DataLoader, Dataset, Sampler

from data.array_store import ArrayStore
from data.samples.cached_frames import CachedFrames, open_drives
from data.samples.config import SampleDataConfig, TrainingDrives
from data.samples.epoch_samplers import ContiguousDistributedSampler, EpochSampler, SampleIndex
from data.samples.splits import Split, random_split
from perception.types import Drive, Int, Progress

Frames = TypeVar("Frames", bound=CachedFrames)
Samples = TypeVar("Samples", bound=Dataset[Any])


class SampleDataModule(LightningDataModule, Generic[Frames, Samples]):
    """Batches of samples of drives on disk: augmented for training, unchanged for validation and test.

    Attributes:
        training: Training samples; there, as all of them, after `setup`.
        validation: Validation samples.
    """

    config: Any
    training: Samples
    validation: Samples
    collate: Callable[[Sequence[Any]], Any] | None = None
    """Function from samples to a batch; None stacks equal shapes."""

    def __init__(
        self,
        drives: TrainingDrives,
        config: SampleDataConfig,
        seed: int = 0,
        progress: Progress = iter,
    ) -> None:
        """Take what `setup` needs; nothing is read yet.

        Args:
            drives: Drives for training and validation.
            config: Split, batches and cache.
            seed: Seed of the split, the order and the augmentation.
            progress: Wrapper of the loop over frames that may show its progress.
        """
        super().__init__()
        self.drives, self.seed = drives, seed
        self.config, self._progress = config, progress

    def prepare_data(self) -> None:
        """Fill the cache; with several GPUs, in one process only.

        Raises:
            PerceptionError: a drive cannot be opened or read, or lacks labels, images or calibration.
        """
        for frames in self._parts():
            self._fill_cache(frames)

    def setup(self, stage: str | None = None) -> None:
        """Make the datasets of training and validation.

        Raises:
            LabelError: a part lacks a class that the network needs.
            UsageError: the split leaves nothing of a part.
            PerceptionError: a drive cannot be opened or read, or lacks labels, images or calibration.
        """
        training, *others = self._parts()
        split = self._split(training)
        if others:
            self._make_datasets(training, split, others[0], np.arange(len(others[0])))
        else:
            self._make_datasets(training, split, training, split.validation)

    def train_dataloader(self) -> DataLoader[Any]:
        """Return batches in a new order, as new augmented views, at every epoch."""
        sampler = self._epoch_sampler()
        trainer = self.trainer
        if trainer is None:
            return self._loader(self.training, sampler)
        # Workers start before Lightning says which epoch a resumed training continues with.
        sampler.set_epoch(trainer.current_epoch)
        share = ContiguousDistributedSampler(sampler, trainer.global_rank, trainer.world_size)
        return self._loader(self.training, share)

    def val_dataloader(self) -> DataLoader[Any]:
        """Return batches of all validation samples in order."""
        return self._loader(self.validation)

    @property
    def augmentation(self) -> Any:  # noqa: ANN401 - the subclass' own configuration
        """Magnitudes of the augmentation, None without."""
        return self.config.augmentation if self.config.augment else None

    @abstractmethod
    def _open_frames(self, drives: Sequence[Drive], store: ArrayStore) -> Frames:
        """Return the frames of drives."""

    @abstractmethod
    def _fill_cache(self, frames: Frames) -> None:
        """Compute what training needs of all frames."""

    @abstractmethod
    def _make_datasets(
        self, frames: Frames, split: Split, validation_frames: Frames, validation: Int
    ) -> None:
        """Make the datasets.

        Args:
            frames: Frames of the training drives.
            split: Split of these frames.
            validation_frames: Frames of the validation drives, or the same frames where there are none.
            validation: (V,) numbers of those used for validation.
        """

    @abstractmethod
    def _epoch_sampler(self) -> EpochSampler:
        """Return the order of the training samples."""

    def _split(self, frames: Frames) -> Split:
        config = self.config
        return random_split(
            frames.drive_numbers,
            validation_fraction=0.0 if self.drives.validation else config.validation_fraction,
            by=config.split_by,
            seed=self.seed,
        )

    def _parts(self) -> list[Frames]:
        config = self.config
        store = ArrayStore(config.cache, int(config.cache_gb * 1e9))
        return [self._open_frames(open_drives(paths), store) for paths in self.drives.parts]

    def _loader(
        self, samples: Samples, sampler: Sampler[SampleIndex] | None = None
    ) -> DataLoader[Any]:
        """Return batches; workers leave the cores to each other."""
        config, trainer = self.config, self.trainer
        if config.workers > 0:
            # Set before the workers are forked: one that gave up OpenCV's threads itself, which exist in the
            # parent only, would wait for them forever.
            cv2.setNumThreads(1)
        return DataLoader(
            samples,
            batch_size=config.batch_size,
            sampler=sampler,
            num_workers=config.workers,
            persistent_workers=config.workers > 0,
            pin_memory=trainer is not None and trainer.strategy.root_device.type != "cpu",
            collate_fn=self.collate,
        )
