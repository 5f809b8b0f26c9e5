"""As many vehicles as others in every batch, whatever the set holds (6.1.4)."""

import numpy as np

from data.epoch_sampler import EpochSampler
from perception.types import Bool, Int


class BalancedSampler(EpochSampler):
    """Vehicles and others in turn, each class in a new random order whenever all of it was seen."""

    def __init__(self, is_vehicle: Bool, seed: int = 0, length: int | None = None) -> None:
        """Keep the rows of both classes.

        Args:
            is_vehicle: (M,) of the candidates, both classes among them.
            seed: of the order.
            length: samples an epoch; else as many as there are candidates.
        """
        super().__init__(seed)
        self._classes = [np.flatnonzero(is_vehicle), np.flatnonzero(~is_vehicle)]
        self._half = max((len(is_vehicle) if length is None else length) // 2, 1)

    def __len__(self) -> int:
        return 2 * self._half

    def _order(self, rng: np.random.Generator) -> Int:
        turns = [_in_cycles(rows, self._half, rng) for rows in self._classes]
        return np.array(turns, np.int64).T.ravel()


def _in_cycles(rows: Int, count: int, rng: np.random.Generator) -> Int:
    """Return so many rows, all of them once before any of them again."""
    cycles = -(-count // len(rows))
    return np.concatenate([rng.permutation(rows) for _ in range(cycles)])[:count]
