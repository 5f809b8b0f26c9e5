"""The order of samples in an epoch; it depends on seed and epoch alone, so that resumed training repeats it."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from itertools import islice
from typing import NamedTuple, TypeVar

import numpy as np
from torch.utils.data import Sampler

from perception.types import Bool, Int

Item = TypeVar("Item")


class SampleIndex(NamedTuple):
    """A sample, and which of its augmented views.

    Attributes:
        row: Row of the sample in the dataset.
        view: Numbers that seed the augmentation: epoch and position within it.
    """

    row: int
    view: tuple[int, ...]


class EpochSampler(Sampler[SampleIndex], ABC):
    """Samples in a new order at every epoch, each as a new augmented view. Subclasses give the order."""

    def __init__(self, seed: int) -> None:
        """Take the seed of the order."""
        self._seed, self._epoch = seed, 0

    def set_epoch(self, epoch: int) -> None:
        """Set the next epoch; called by Lightning."""
        self._epoch = epoch

    def __iter__(self) -> Iterator[SampleIndex]:
        rows = self._rows(np.random.default_rng([self._seed, self._epoch]))
        for position, row in enumerate(rows.tolist()):
            yield SampleIndex(row, (self._epoch, position))

    @abstractmethod
    def __len__(self) -> int: ...

    @abstractmethod
    def _rows(self, rng: np.random.Generator) -> Int:
        """Return the rows of an epoch in order."""


class ShuffledSampler(EpochSampler):
    """All samples in a new random order at every epoch."""

    def __init__(self, length: int, seed: int = 0) -> None:
        """Take the number of samples and the seed of the order."""
        super().__init__(seed)
        self._length = length

    def __len__(self) -> int:
        return self._length

    def _rows(self, rng: np.random.Generator) -> Int:
        return rng.permutation(self._length)


class BalancedSampler(EpochSampler):
    """Vehicles and others in turn (6.1.4), each class in a new random order whenever it is used up."""

    def __init__(self, is_vehicle: Bool, seed: int = 0, length: int | None = None) -> None:
        """Take the rows of both classes.

        Args:
            is_vehicle: (M,) mask of the vehicles; both classes occur.
            seed: Seed of the order.
            length: Samples per epoch; else M.
        """
        super().__init__(seed)
        self._classes = [np.flatnonzero(is_vehicle), np.flatnonzero(~is_vehicle)]
        self._half = max((len(is_vehicle) if length is None else length) // 2, 1)

    def __len__(self) -> int:
        return 2 * self._half

    def _rows(self, rng: np.random.Generator) -> Int:
        by_class = [_in_cycles(rows, self._half, rng) for rows in self._classes]
        return np.array(by_class, np.int64).T.ravel()


class DistributedBatchSampler(Sampler[Item]):
    """A run of each global batch of another sampler for each training process, all of one length.

    The batches of all processes at one step have the members of one batch of a single process that takes as many
    samples at once. Of an epoch that cannot be shared out evenly, the last items are left out: fewer than there
    are processes.

        items    0 1 2 3 4 5 6 7 8 9 10, batches of 2, 2 processes
        first    0 1     4 5     8
        second       2 3     6 7   9

    Lightning's own distributed sampler takes every n-th item: of two classes that alternate, two processes
    would get one each. It also hides `set_epoch` of the sampler it wraps.
    """

    def __init__(self, whole: Sampler[Item], batch_size: int, process: int, processes: int) -> None:
        """Take a share of a sampler.

        Args:
            whole: Sampler with a length, and optionally `set_epoch`.
            batch_size: Samples per batch of one process.
            process: Rank of the process, from 0.
            processes: Number of processes.
        """
        self._whole, self._batch_size = whole, batch_size
        self._process, self._processes = process, processes
        self._length = len(whole) // processes  # type: ignore[arg-type]

    def set_epoch(self, epoch: int) -> None:
        """Set the next epoch; called by Lightning."""
        if hasattr(self._whole, "set_epoch"):
            self._whole.set_epoch(epoch)

    def __len__(self) -> int:
        return self._length

    def __iter__(self) -> Iterator[Item]:
        items, left = iter(self._whole), self._length
        while left > 0:
            size = min(self._batch_size, left)
            of_all = list(islice(items, size * self._processes))
            yield from of_all[size * self._process : size * (self._process + 1)]
            left -= size


def _in_cycles(rows: Int, count: int, rng: np.random.Generator) -> Int:
    """Return `count` rows in random order; each occurs once before any occurs again."""
    cycles = -(-count // len(rows))
    return np.concatenate([rng.permutation(rows) for _ in range(cycles)])[:count]
