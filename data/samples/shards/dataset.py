"""Samples that are read from shards as they are needed: a few shards are in memory, none is on disk."""

import hashlib
from collections import Counter, OrderedDict
from collections.abc import Sequence

import numpy as np

from data.remote_folder import RemoteFolder
from data.samples.epoch_samplers import EpochSampler
from data.samples.images.config import ImageAugmentationConfig
from data.samples.images.dataset import Samples
from data.samples.images.input_images import ImageConfig
from data.samples.images.targets import DetectionTargets, detection_targets
from data.samples.shards.index import Shard, ShardIndex
from data.samples.shards.samples import ShardSample, unpack
from data.splits.training_frames import TrainingFrames
from perception.errors import DriveError
from perception.types import Float64, Int, UInt8

# Shards among which samples are mixed; a reader keeps one more.
WINDOW = 4


class ShardSampler(EpochSampler):
    """All samples at every epoch, but for less than one a reader, so that all readers have equally many.

    Shards are in a new order at every epoch, and cut into one run for each reader: each worker of each training process.
    A reader mixes the samples of `WINDOW` shards at a time. The whole order has a batch of each process in turn, as
    `DistributedBatchSampler` shares it out, and in that of a process a batch of each worker, as torch hands them out.
    """

    def __init__(
        self,
        sizes: Int,
        seed: int = 0,
        *,
        processes: int = 1,
        workers: int = 1,
        batch_size: int = 1,
    ) -> None:
        """Take the shards and their readers.

        Args:
            sizes: (S,) number of samples of each shard; rows are numbered over all of them.
            seed: Seed of the order.
            processes: Training processes.
            workers: Loading processes of each, at least 1; those beyond its number of samples have no run of their own.
            batch_size: Samples of a batch.
        """
        super().__init__(seed)
        self._first = np.concatenate([[0], np.cumsum(sizes)])
        self._processes, self._batch_size = processes, batch_size
        self._mixed = WINDOW * int(max(sizes))
        samples = int(self._first[-1]) // processes
        self._workers = min(workers, max(samples, 1))
        self._length = samples // self._workers

    def __len__(self) -> int:
        return self._processes * self._workers * self._length

    def _rows(self, rng: np.random.Generator) -> Int:
        shards = [
            np.arange(self._first[shard], self._first[shard + 1])
            for shard in rng.permutation(len(self._first) - 1)
        ]
        runs = np.concatenate(shards)[: len(self)].reshape(self._processes, self._workers, -1)
        return self._in_turn([self._in_turn([self._mix(run, rng) for run in of]) for of in runs])

    def _mix(self, run: Int, rng: np.random.Generator) -> Int:
        parts = np.split(run, range(self._mixed, len(run), self._mixed))
        return np.concatenate([rng.permutation(part) for part in parts])

    def _in_turn(self, runs: list[Int]) -> Int:
        """Return runs of one length, a batch of each in turn, then what is left of each."""
        whole = len(runs[0]) - len(runs[0]) % self._batch_size
        batches = np.stack([run[:whole].reshape(-1, self._batch_size) for run in runs], axis=1)
        return np.concatenate([batches.ravel(), *[run[whole:] for run in runs]])


class ShardSet:
    """All shards of some folders, numbered one after another.

    Attributes:
        sizes: (S,) number of samples of each shard.
    """

    def __init__(self, urls: Sequence[str], config: ImageConfig) -> None:
        """Read the indices.

        Args:
            urls: Folders of shards.
            config: Input of the network.

        Raises:
            DriveError: An index cannot be read.
            UsageError: One is damaged, or of samples of another input.
        """
        self._indices = list[ShardIndex]()
        self._shards = list[tuple[RemoteFolder, Shard]]()
        for url in urls:
            folder = RemoteFolder(url)
            index = ShardIndex.read(folder)
            index.require(config, url)
            self._indices.append(index)
            self._shards += [(folder, shard) for shard in index.shards]
        self.sizes: Int = np.array([shard.samples for _, shard in self._shards], np.int64)
        self._first = np.concatenate([[0], np.cumsum(self.sizes)])
        self._kept = OrderedDict[int, list[ShardSample]]()

    def __len__(self) -> int:
        return int(self._first[-1])

    def __getitem__(self, row: int) -> ShardSample:
        """Return a sample; its shard is read where it is not among the last ones that were used.

        Raises:
            DriveError: The shard cannot be read, or is damaged.
        """
        number = int(np.searchsorted(self._first, row, side="right")) - 1
        if number not in self._kept:
            self._kept[number] = self._read(number)
            if len(self._kept) > WINDOW + 1:
                self._kept.popitem(last=False)
        self._kept.move_to_end(number)
        return self._kept[number][row - int(self._first[number])]

    @property
    def label_counts(self) -> Counter[str]:
        """Labels that are visible enough to be learned, by type."""
        return sum((Counter(index.label_counts) for index in self._indices), Counter[str]())

    @property
    def frames(self) -> TrainingFrames | None:
        """Frames of the samples; None where they are not known."""
        found: TrainingFrames | None = TrainingFrames(frozenset())
        for index in self._indices:
            found = found.joined(index.frames) if found and index.frames else None
        return found

    def label_sizes_px(self, class_names: Sequence[str]) -> Float64:
        """Return (M, 2) widths and heights of some of the labels of classes, in pixels of the input."""
        wanted = {name.lower() for name in class_names}
        rows = [
            np.reshape(np.asarray(sizes_px, np.float64), (-1, 2))
            for index in self._indices
            for name, sizes_px in index.label_sizes_px.items()
            if name.lower() in wanted
        ]
        return np.concatenate([np.zeros((0, 2)), *rows])

    def _read(self, number: int) -> list[ShardSample]:
        folder, shard = self._shards[number]
        data = folder.read(shard.name)
        if hashlib.sha256(data).hexdigest() != shard.sha256:
            raise DriveError(
                f"{folder.url}/{shard.name}",
                expected="the shard that the index names",
                found=f"{len(data)} bytes of another hash",
                advice="write the shards again, or copy the file again",
            )
        return unpack(data)


class ShardedImages(Samples):
    """Samples of shards for training, by row (unchanged) or by `SampleIndex` (augmented), as those of `ImageDataset`."""

    def __init__(
        self,
        shards: ShardSet,
        config: ImageConfig,
        augmentation: ImageAugmentationConfig | None = None,
        seed: int = 0,
    ) -> None:
        """Take the shards.

        Args:
            shards: Shards of samples of this input.
            config: Input of the network.
            augmentation: Magnitudes of the augmentation; None leaves samples unchanged.
            seed: Seed of the augmentation.
        """
        super().__init__(config, augmentation, seed)
        self.shards = shards

    def __len__(self) -> int:
        return len(self.shards)

    def unchanged(self, row: int) -> tuple[UInt8, DetectionTargets]:
        """Return the (h, w, C) image and the targets of a sample.

        Raises:
            DriveError: Its shard cannot be read.
        """
        sample = self.shards[row]
        placement = self.config.placement(sample.region)
        targets = detection_targets(sample.labels, self.config.class_names, placement)
        return sample.image(self.config.modality), targets

    def target_types(self) -> Counter[str]:
        """Return the number of targets of each class, which excludes objects that are hard to see."""
        counts = Counter[str]()
        for name, count in self.shards.label_counts.items():
            counts[name.lower()] += count
        return Counter({name: counts[name.lower()] for name in self.config.class_names})

    def label_sizes_px(self) -> Float64:
        """Return (M, 2) widths and heights of targets in pixels of the input, of many at most 10,000 a class."""
        return self.shards.label_sizes_px(self.config.class_names)
