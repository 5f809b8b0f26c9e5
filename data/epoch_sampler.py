"""Which sample is asked for, and which of its looks: what makes training the same again after a resume."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from torch.utils.data import Sampler

from perception.types import Int


class SampleIndex(NamedTuple):
    """Which sample is asked for, and which of its looks.

    Attributes:
        row: of the set of samples.
        view: numbers that the change is drawn by, such as the epoch and the place within it.
    """

    row: int
    view: tuple[int, ...]


class EpochSampler(Sampler[SampleIndex], ABC):
    """Samples in an order of their own at every epoch, each with a new look; subclasses say which order.

    What an epoch holds depends on the seed and its number alone, so that training that is resumed goes on
    as if it had never stopped.
    """

    def __init__(self, seed: int) -> None:
        """Keep the seed of the order."""
        self._seed, self._epoch = seed, 0

    def set_epoch(self, epoch: int) -> None:
        """Say which epoch is next, as Lightning does."""
        self._epoch = epoch

    def __iter__(self) -> Iterator[SampleIndex]:
        order = self._order(np.random.default_rng([self._seed, self._epoch]))
        for place, row in enumerate(order.tolist()):
            yield SampleIndex(row, (self._epoch, place))

    @abstractmethod
    def __len__(self) -> int: ...

    @abstractmethod
    def _order(self, rng: np.random.Generator) -> Int:
        """Return the rows of an epoch."""


class ShuffledSampler(EpochSampler):
    """All samples, in a new random order at every epoch."""

    def __init__(self, length: int, seed: int = 0) -> None:
        """Keep how many samples there are, and the seed of the order."""
        super().__init__(seed)
        self._length = length

    def __len__(self) -> int:
        return self._length

    def _order(self, rng: np.random.Generator) -> Int:
        return rng.permutation(self._length)
