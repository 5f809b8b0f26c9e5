"""Scans of drives on disk as maps from above, in batches, for Lightning."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from data.array_store import ArrayStore
from data.label_proposals.proposed_labels import read_proposals
from data.samples.bev.config import BevDataConfig
from data.samples.bev.dataset import BevConfig, BevDataset, collate
from data.samples.bev.labelled_scans import LabelledScans
from data.samples.config import TrainingDrives
from data.samples.datamodule import SampleDataModule
from data.samples.epoch_samplers import ShuffledSampler
from data.samples.labelled_parts import warn_of_few, warn_of_missing
from perception.types import Drive

_BEV = BevConfig()


class BevDataModule(SampleDataModule[LabelledScans, BevDataset]):
    """Batches of maps from above: augmented for training, unchanged for validation and test.

    A batch holds what `BevDataset` says of a sample, with a first axis of samples; targets are padded with boxes of
    zero size.
    """

    config: BevDataConfig
    collate = staticmethod(collate)

    def __init__(
        self,
        drives: Sequence[Path] = (),
        validation: Sequence[Path] = (),
        *,
        split: Path | None = None,
        bev: BevConfig = _BEV,
        proposals: dict[str, Path] | None = None,
        seed: int = 0,
        **config: Any,  # noqa: ANN401 - jsonargparse reads the fields from the class
    ) -> None:
        """Take what `setup` needs; nothing is read yet.

        Args:
            drives: Labelled drives of any layout; of a folder of several, all are taken.
            validation: Labelled drives for validation; else a fraction of the frames is kept back.
            split: File of `trifuse split`, which names the frames of each part, and drives where none are given.
            bev: Input and classes of the network.
            proposals: Folders of `trifuse label` by the name of a drive, whose proposals are learned in place of its labels:
                {"0000": "my_labels"}.
            seed: Seed of split, order and augmentation.
            config: Fields of `BevDataConfig`.
        """
        sources = TrainingDrives(tuple(drives), tuple(validation), split)
        super().__init__(sources, BevDataConfig(**config), seed)
        self.bev = bev
        self._proposals = read_proposals(proposals)

    def _open_frames(self, drives: Sequence[Drive], store: ArrayStore) -> LabelledScans:
        return LabelledScans(drives, self.bev.grid, store, self._proposals)

    def _fill_cache(self, frames: LabelledScans) -> None:
        for number in self.progress(range(len(frames))):
            frames.make(number)

    def _make_dataset(self, frames: LabelledScans, *, is_training: bool) -> BevDataset:
        augmentation = self.augmentation if is_training else None
        return BevDataset(frames, np.arange(len(frames)), self.bev, augmentation, self.seed)

    def _require_labels(self) -> None:
        names, seen, learned = self.bev.class_names, "labels with returns", self.training
        warn_of_missing(names, learned.target_types(), f"{seen} of the training scans")
        names = tuple(name for name in names if learned.target_types()[name])
        warn_of_few(names, self.validation.target_types(), f"{seen} of the validation scans")

    def _epoch_sampler(self) -> ShuffledSampler:
        return ShuffledSampler(len(self.training), self.seed)
