"""The order of samples in shards: each process and each of its workers reads shards of its own, one after another."""

import numpy as np

from data.samples.epoch_samplers import EpochSampler
from perception.types import Int

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
