"""As many vehicles as others in every batch, whatever the set holds (6.1.4)."""

from collections.abc import Iterator

import numpy as np
from torch.utils.data import Sampler

from data.looks import Ask
from perception.types import Bool, Int


class BalancedSampler(Sampler[Ask]):
    """Vehicles and others in turn, each class in a new random order whenever all of it was seen.

    What an epoch holds depends on the seed and its number alone, so that training that is resumed goes on
    as if it had never stopped.
    """

    def __init__(self, is_vehicle: Bool, seed: int = 0, length: int | None = None) -> None:
        """Keep the rows of both classes.

        Args:
            is_vehicle: (M,) of the candidates, both classes among them.
            seed: of the order.
            length: samples an epoch; else as many as there are candidates.
        """
        self._classes = [np.flatnonzero(is_vehicle), np.flatnonzero(~is_vehicle)]
        self._seed = seed
        self._half = max((len(is_vehicle) if length is None else length) // 2, 1)
        self._epoch = 0

    def set_epoch(self, epoch: int) -> None:
        """Say which epoch is next, as Lightning does."""
        self._epoch = epoch

    def __len__(self) -> int:
        return 2 * self._half

    def __iter__(self) -> Iterator[Ask]:
        rng = np.random.default_rng([self._seed, self._epoch])
        turns = np.stack([_in_cycles(rows, self._half, rng) for rows in self._classes], axis=1)
        for place, row in enumerate(turns.ravel().tolist()):
            yield Ask(row, (self._epoch, place))


def _in_cycles(rows: Int, count: int, rng: np.random.Generator) -> Int:
    """Return so many rows, all of them once before any of them again."""
    cycles = -(-count // len(rows))
    return np.concatenate([rng.permutation(rows) for _ in range(cycles)])[:count]
