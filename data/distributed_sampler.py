"""What one of several training processes takes of an epoch."""

from collections.abc import Iterator
from itertools import islice
from typing import TypeVar

from torch.utils.data import Sampler

Item = TypeVar("Item")


class ContiguousDistributedSampler(Sampler[Item]):
    """One run of consecutive items of another sampler, as long for every process.

    Lightning's own share takes every n-th item: of two classes that come in turn, two processes would get
    one each. It also keeps the number of the epoch from the sampler that it shares out.
    """

    def __init__(self, whole: Sampler[Item], process: int, processes: int) -> None:
        """Take a share.

        Args:
            whole: what is shared out; it has a length, and may have `set_epoch`.
            process: whose share this is, from 0.
            processes: how many there are.
        """
        self._whole, self._process = whole, process
        self._length = len(whole) // processes  # type: ignore[arg-type]

    def set_epoch(self, epoch: int) -> None:
        """Say which epoch is next, as Lightning does."""
        if hasattr(self._whole, "set_epoch"):
            self._whole.set_epoch(epoch)

    def __len__(self) -> int:
        return self._length

    def __iter__(self) -> Iterator[Item]:
        first = self._process * self._length
        return islice(iter(self._whole), first, first + self._length)
