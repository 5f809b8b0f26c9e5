"""Images of drives on disk, in batches, for Lightning."""

import logging
import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from torch.utils.data import DataLoader

from data.array_store import ArrayStore
from data.samples.config import TrainingDrives
from data.samples.datamodule import SampleDataModule
from data.samples.epoch_samplers import ShuffledSampler
from data.samples.images.config import ImageAugmentationConfig, ImageDataConfig
from data.samples.images.dataset import ImageDataset, collate
from data.samples.images.input_images import ImageConfig
from data.samples.images.labelled_images import LabelledImages
from data.samples.labelled_classes import require_classes, warn_of_few
from data.samples.splits import Split, random_split, split_from_lists
from perception.errors import PerceptionError, UsageError
from perception.types import Drive, Int, Progress

log = logging.getLogger(__name__)
_CONFIG = ImageDataConfig()


class ImageDataModule(SampleDataModule[LabelledImages, ImageDataset]):
    """Batches of images of one modality: augmented for training, unchanged for validation and test.

    A batch holds what `ImageDataset` says of a sample, with a first axis of samples; targets are padded with
    boxes of zero size.

    Attributes:
        test: Samples of the final test; empty without a test fraction.
    """

    config: ImageDataConfig
    test: ImageDataset
    collate = staticmethod(collate)

    def __init__(
        self,
        drives: TrainingDrives,
        image: ImageConfig,
        config: ImageDataConfig = _CONFIG,
        seed: int = 0,
        progress: Progress = iter,
    ) -> None:
        """Take what `setup` needs; nothing is read yet.

        Args:
            drives: Drives for training and validation.
            image: Input of the network.
            config: Split, batches and augmentation.
            seed: Seed of split, order and augmentation.
            progress: Wrapper of the loop over frames that may show its progress.
        """
        super().__init__(drives, config, seed, progress)
        self.image = image

    def prepare_data(self) -> None:
        """Validate the classes, then fill the cache; with several GPUs, in one process only.

        Raises:
            LabelError: no label is of one of the classes.
            PerceptionError: a drive cannot be opened or read, or lacks labels, images or calibration.
        """
        labels = self._parts()[0].label_types()
        require_classes(self.image.class_names, labels, f"labels of {self.drives.names}")
        super().prepare_data()

    def test_dataloader(self) -> DataLoader[Any]:
        """Return batches of all test samples in order."""
        return self._loader(self.test)

    def _open_frames(self, drives: Sequence[Drive], store: ArrayStore) -> LabelledImages:
        return LabelledImages(drives, self.image, store)

    def _fill_cache(self, frames: LabelledImages) -> None:
        self._readable(frames, self._progress(range(len(frames))), is_logged=False)

    def _split(self, frames: LabelledImages) -> Split:
        config, has_drives = self.config, bool(self.drives.validation)
        if config.frame_lists is None:
            return random_split(
                frames.drive_numbers,
                validation_fraction=0.0 if has_drives else config.validation_fraction,
                test_fraction=config.test_fraction,
                by=config.split_by,
                seed=self.seed,
            )
        if has_drives or len(frames.drives) > 1 or config.test_fraction > 0:
            raise UsageError(
                "lists of frames",
                expected="one drive, no validation drives and no test fraction beside them",
                found=f"{len(frames.drives)} drives, {len(self.drives.validation)} validation drives "
                f"and a test fraction of {config.test_fraction:g}",
            )
        return split_from_lists(frames.file_numbers, config.frame_lists)

    def _make_datasets(
        self,
        frames: LabelledImages,
        split: Split,
        validation_frames: LabelledImages,
        validation: Int,
    ) -> None:
        count = math.ceil(self.config.training_fraction * len(split.training))
        self.training = self._dataset(frames, split.training[:count], self.augmentation)
        self.validation = self._dataset(validation_frames, validation, None)
        self.test = self._dataset(frames, split.test, None)
        names, seen = self.image.class_names, "labels that are visible enough"
        require_classes(names, self.training.target_types(), f"{seen} of the training images")
        measured, where = self.validation.target_types(), f"{seen} of the validation images"
        if not measured:
            require_classes(names, measured, where)
        warn_of_few(names, measured, where)

    def _epoch_sampler(self) -> ShuffledSampler:
        return ShuffledSampler(len(self.training), self.seed)

    def _dataset(
        self, frames: LabelledImages, numbers: Int, augmentation: ImageAugmentationConfig | None
    ) -> ImageDataset:
        found = self._readable(frames, numbers.tolist())
        return ImageDataset(frames, found, augmentation, self.seed)

    def _readable(
        self, frames: LabelledImages, numbers: Iterable[int], *, is_logged: bool = True
    ) -> Int:
        """Return the numbers of the frames whose image can be made; images are made where not cached."""
        found = []
        for number in numbers:
            try:
                frames.size_px(number)
            except PerceptionError as error:
                if self.config.on_bad_frame == "stop":
                    raise
                if is_logged:
                    log.warning("skipped frame %d: %s", number, error)
                continue
            found.append(number)
        return np.array(found, np.int64)
