"""Parts of a drive that hold one entry for each frame, and are cut with it."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Self, TypeVar

Entry = TypeVar("Entry")


class PerFrame(ABC):
    """Entries of the frames of a drive, in their order."""

    @abstractmethod
    def select(self, indices: Sequence[int]) -> Self:
        """Return the entries of some frames."""


class FrameTuple(tuple[Entry, ...], PerFrame):
    """A tuple with one entry for each frame."""

    __slots__ = ()

    def select(self, indices: Sequence[int]) -> Self:
        """Return the entries of some frames."""
        return type(self)(self[index] for index in indices)
