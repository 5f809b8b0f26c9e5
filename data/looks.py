"""Which sample is asked for, and which of its looks: what makes training the same again after a resume."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from torch.utils.data import Sampler


class Ask(NamedTuple):
    """Which sample is asked for, and which of its looks.

    Attributes:
        row: of the set of samples.
        look: numbers that the change is drawn by, such as the epoch and the place within it.
    """

    row: int
    look: tuple[int, ...]


class ShuffledLooks(Sampler[Ask]):
    """All samples in a new random order at every epoch, each with a new look.

    What an epoch holds depends on the seed and its number alone, so that training that is resumed goes on
    as if it had never stopped.
    """

    def __init__(self, length: int, seed: int = 0) -> None:
        """Keep how many samples there are, and the seed of the order."""
        self._length, self._seed, self._epoch = length, seed, 0

    def set_epoch(self, epoch: int) -> None:
        """Say which epoch is next, as Lightning does."""
        self._epoch = epoch

    def __len__(self) -> int:
        return self._length

    def __iter__(self) -> Iterator[Ask]:
        order = np.random.default_rng([self._seed, self._epoch]).permutation(self._length)
        for place, row in enumerate(order.tolist()):
            yield Ask(row, (self._epoch, place))
