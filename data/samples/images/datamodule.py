"""Images of drives on disk, in batches, for Lightning."""

import logging
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from data.array_store import ArrayStore
from data.label_proposals.proposed_labels import read_proposals
from data.samples.config import TrainingDrives
from data.samples.datamodule import SampleDataModule
from data.samples.epoch_samplers import EpochSampler, ShuffledSampler
from data.samples.images.config import ImageDataConfig
from data.samples.images.dataset import ImageDataset, Samples, collate
from data.samples.images.input_images import ImageConfig
from data.samples.images.labelled_images import LabelledImages
from data.samples.labelled_parts import LabelledParts, require_classes, warn_of_few
from data.samples.shards.dataset import ShardedImages, ShardSampler, ShardSet
from perception.errors import PerceptionError
from perception.types import Drive, Int

log = logging.getLogger(__name__)
_IMAGE = ImageConfig("rgb")


class ImageDataModule(SampleDataModule[LabelledImages, ImageDataset]):
    """Batches of images of one modality: augmented for training, unchanged for validation and test.

    A batch holds what `ImageDataset` says of a sample, with a first axis of samples; targets are padded with
    boxes of zero size.
    """

    config: ImageDataConfig
    training: Samples
    collate = staticmethod(collate)

    def __init__(  # noqa: PLR0913 - the flags of a group
        self,
        drives: Sequence[Path] = (),
        validation: Sequence[Path] = (),
        *,
        split: Path | None = None,
        shards: Sequence[str] = (),
        image: ImageConfig = _IMAGE,
        proposals: dict[str, Path] | None = None,
        seed: int = 0,
        **config: Any,  # noqa: ANN401 - jsonargparse reads the fields from the class
    ) -> None:
        """Take what `setup` needs; nothing is read yet.

        Args:
            drives: Labelled drives of any layout; of a folder of several, all are taken.
            validation: Labelled drives for validation; else a fraction of the frames is kept back.
            split: File of `trifuse split`, which names the frames of each part, and drives where none are given.
            shards: Folders or URLs of shards, as `trifuse shards` writes them, that train in place of drives.
            image: Input of the network.
            proposals: Folders of `trifuse label` by the name of a drive, whose proposals in the image are learned in place of
                its labels: {"0000": "my_labels"}.
            seed: Seed of split, order and augmentation.
            config: Fields of `ImageDataConfig`.
        """
        sources = TrainingDrives(tuple(drives), tuple(validation), split, tuple(shards))
        super().__init__(sources, ImageDataConfig(**config), seed)
        self.image, self._proposals = image, read_proposals(proposals)

    def prepare_data(self) -> None:
        """Validate the classes, then fill the cache; with several GPUs, in one process only.

        Raises:
            LabelError: no label is of one of the classes.
            PerceptionError: a drive cannot be opened or read, or lacks labels, images or calibration.
        """
        if self.drives.shards:
            labels = ShardSet(self.drives.shards, self.image).label_counts
        else:
            labels = self._frames(self._parts().train).label_types()
        require_classes(self.image.class_names, labels, f"labels of {self.drives.names}")
        super().prepare_data()

    def _open_frames(self, drives: Sequence[Drive], store: ArrayStore) -> LabelledImages:
        return LabelledImages(drives, self.image, store, self._proposals)

    def _fill_cache(self, frames: LabelledImages) -> None:
        self._readable(frames, self.progress(range(len(frames))), is_logged=False)

    def _make_dataset(self, frames: LabelledImages, *, is_training: bool) -> ImageDataset:
        found = self._readable(frames, range(len(frames)))
        return ImageDataset(frames, found, self.augmentation if is_training else None, self.seed)

    def _parts(self) -> LabelledParts:
        parts = super()._parts()
        if not self.drives.shards:
            return parts
        return replace(parts, streamed=ShardSet(self.drives.shards, self.image).frames)

    def _training_samples(self, parts: LabelledParts) -> Samples:
        if not self.drives.shards:
            return self._make_dataset(self._frames(parts.train), is_training=True)
        shards = ShardSet(self.drives.shards, self.image)
        return ShardedImages(shards, self.image, self.augmentation, self.seed)

    def _require_labels(self) -> None:
        names, seen = self.image.class_names, "labels that are visible enough"
        require_classes(names, self.training.target_types(), f"{seen} of the training images")
        measured, where = self.validation.target_types(), f"{seen} of the validation images"
        if not measured:
            require_classes(names, measured, where)
        warn_of_few(names, measured, where)

    def _epoch_sampler(self) -> EpochSampler:
        if not isinstance(self.training, ShardedImages):
            return ShuffledSampler(len(self.training), self.seed)
        return ShardSampler(
            self.training.shards.sizes,
            self.seed,
            processes=1 if self.trainer is None else self.trainer.world_size,
            workers=max(self.workers, 1),
            batch_size=self.config.batch_size,
        )

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
                    log.warning("skipped frame %s: %s", frames.name(number), error)
                continue
            found.append(number)
        return np.array(found, np.int64)
