"""The base of Lightning data modules over labelled drives: caching, the parts of a split, and batches."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Generic, TypeVar

import cv2
from lightning.pytorch import LightningDataModule
from torch.utils.data import DataLoader, Dataset, Sampler

from data.array_store import ArrayStore
from data.batch.parts import fill_together
from data.samples.cached_frames import CachedFrames
from data.samples.config import SampleDataConfig, TrainingDrives
from data.samples.epoch_samplers import DistributedBatchSampler, EpochSampler, SampleIndex
from data.samples.labelled_parts import LabelledParts, first_frames, open_parts
from data.splits.training_frames import ENTRY, TrainingFrames
from perception.errors import UsageError
from perception.geometry.threads import usable_cores
from perception.types import Drive, Progress

_MAX_WORKERS = 8

Frames = TypeVar("Frames", bound=CachedFrames)
Samples = TypeVar("Samples", bound=Dataset[Any])


class SampleDataModule(LightningDataModule, Generic[Frames, Samples]):
    """Batches of samples of drives on disk: augmented for training, unchanged for validation and test.

    Attributes:
        training: Training samples; there, as all of them, after `setup`.
        validation: Validation samples.
        test: Samples of the final test; None where the split has no such part.
        progress: Wrapper of the loop over frames that may show its progress.
    """

    config: Any
    training: Any
    validation: Samples
    test: Samples | None
    collate: Callable[[Sequence[Any]], Any] | None = None
    """Function from samples to a batch; None stacks equal shapes."""

    def __init__(
        self,
        drives: TrainingDrives,
        config: SampleDataConfig,
        seed: int = 0,
    ) -> None:
        """Take what `setup` needs; nothing is read yet.

        Args:
            drives: Drives for training and validation, or a split.
            config: Split, batches and cache.
            seed: Seed of the split, the order and the augmentation.
        """
        super().__init__()
        self.drives, self.config, self.seed = drives, config, seed
        self.progress: Progress = iter

    def prepare_data(self) -> None:
        """Fill the cache; with several GPUs, in one process only.

        Raises:
            PerceptionError: a drive cannot be opened or read, or lacks labels, images or calibration.
        """
        parts = self._parts()
        frames = self._frames([*parts.train, *parts.val, *parts.test])
        fill_together(frames.fill, frames.missing(), self.config.cache_workers, self.progress)
        self._fill_cache(frames)

    def setup(self, stage: str | None = None) -> None:
        """Make the datasets; a network that is trained notes the frames that it learns from.

        Raises:
            LabelError: a part lacks a class that the network needs.
            UsageError: the split leaves nothing of a part.
            PerceptionError: a drive cannot be opened or read, or lacks labels, images or calibration.
        """
        parts = self._parts()
        self.training = self._training_samples(parts)
        self.validation = self._make_dataset(self._frames(parts.val), is_training=False)
        self.test = None
        if parts.test:
            self.test = self._make_dataset(self._frames(parts.test), is_training=False)
        self._require_labels()
        if stage == "fit" and self.trainer is not None and self.trainer.is_global_zero:
            noted = self.trainer.lightning_module.hparams
            # Initial weights of another training have learned from its frames.
            earlier = {ENTRY: "", **noted}
            noted.update(parts.provenance(TrainingFrames.from_metadata(earlier, "initial weights")))

    def train_dataloader(self) -> DataLoader[Any]:
        """Return batches in a new order, as new augmented views, at every epoch."""
        sampler = self._epoch_sampler()
        trainer = self.trainer
        if trainer is None:
            return self._loader(self.training, sampler)
        # Workers start before Lightning says which epoch a resumed training continues with.
        sampler.set_epoch(trainer.current_epoch)
        share = DistributedBatchSampler(
            sampler, self.config.batch_size, trainer.global_rank, trainer.world_size
        )
        return self._loader(self.training, share)

    def val_dataloader(self) -> DataLoader[Any]:
        """Return batches of all validation samples in order."""
        return self._loader(self.validation)

    def test_dataloader(self) -> DataLoader[Any]:
        """Return batches of all test samples in order.

        Raises:
            UsageError: the split has no such part.
        """
        if self.test is None:
            raise UsageError(
                "test",
                expected="a split with frames of part test",
                found="none",
                advice="pass --split FILE, made with: trifuse split --shares 60,20,20",
            )
        return self._loader(self.test)

    @property
    def training_data(self) -> str:
        """Names of the training drives, as model files state them."""
        return self.drives.names

    @property
    def workers(self) -> int:
        """Number of processes that load samples.

        A batch of 16 images of 192x640 takes 0.07 s of one core to load and 1.2 s to train the compact detector on,
        so that a CPU gains nothing by loading beside the training. A GPU trains faster than one core loads.
        """
        if self.config.workers is not None:
            return int(self.config.workers)
        if self.trainer is None or not self._is_on_gpu:
            return 0
        return min(usable_cores() // self.trainer.num_devices, _MAX_WORKERS)

    @property
    def _is_on_gpu(self) -> bool:
        return self.trainer is not None and self.trainer.strategy.root_device.type != "cpu"

    @property
    def augmentation(self) -> Any:  # noqa: ANN401 - the subclass' own configuration
        """Magnitudes of the augmentation, None without."""
        return self.config.augmentation if self.config.augment else None

    @abstractmethod
    def _open_frames(self, drives: Sequence[Drive], store: ArrayStore) -> Frames:
        """Return the frames of drives."""

    @abstractmethod
    def _fill_cache(self, frames: Frames) -> None:
        """Make what is not cached yet of all frames, and meet their faults."""

    @abstractmethod
    def _make_dataset(self, frames: Frames, *, is_training: bool) -> Samples:
        """Return the samples of all frames of a part."""

    def _training_samples(self, parts: LabelledParts) -> Any:  # noqa: ANN401 - the subclass' own
        """Return the samples to learn from."""
        return self._make_dataset(self._frames(parts.train), is_training=True)

    @abstractmethod
    def _require_labels(self) -> None:
        """Validate that the datasets hold what the network learns and is measured by."""

    @abstractmethod
    def _epoch_sampler(self) -> EpochSampler:
        """Return the order of the training samples."""

    def _parts(self) -> LabelledParts:
        parts = open_parts(self.drives, self.config, self.seed)
        return replace(parts, train=first_frames(parts.train, self.config.training_fraction))

    def _frames(self, drives: Sequence[Drive]) -> Frames:
        config = self.config
        return self._open_frames(drives, ArrayStore(config.cache, int(config.cache_gb * 1e9)))

    def _loader(
        self, samples: Samples, sampler: Sampler[SampleIndex] | None = None
    ) -> DataLoader[Any]:
        """Return batches; workers leave the cores to each other."""
        workers = self.workers
        if workers > 0:
            # Set before the workers are forked: one that gave up OpenCV's threads itself, which exist in the
            # parent only, would wait for them forever.
            cv2.setNumThreads(1)
        return DataLoader(
            samples,
            batch_size=self.config.batch_size,
            sampler=sampler,
            num_workers=workers,
            persistent_workers=workers > 0,
            pin_memory=self._is_on_gpu,
            collate_fn=self.collate,
        )
