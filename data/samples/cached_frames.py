"""Frames of labelled drives, numbered from 0 over all drives, with arrays computed from them in a cache."""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from data.array_store import Arrays, ArrayStore, entry_key
from data.frame_fingerprint import frame_fingerprint
from data.frames import frame_name
from perception.errors import PerceptionError
from perception.types import Drive, Frame, Int


class CachedFrames(ABC):
    """F frames of some drives; what is computed from each is kept in an `ArrayStore`.

    An entry's key holds all that determines it: the frame's files, the settings, and the code.
    """

    def __init__(self, drives: Sequence[Drive], store: ArrayStore) -> None:
        """Number the frames.

        Args:
            drives: Drives with labels.
            store: Cache of the arrays.
        """
        self.drives, self.store = tuple(drives), store
        self._frames = [(drive, index) for drive in drives for index in range(len(drive))]
        self._keys: dict[tuple[int, str], str] = {}  # an image is needed often, its key is slow

    def __len__(self) -> int:
        return len(self._frames)

    def label_types(self) -> Counter[str]:
        """Return the number of labels of each type.

        Raises:
            PerceptionError: a drive has no labels, or they cannot be read.
        """
        return Counter(
            name
            for drive, index in self._frames
            for name in drive.labels(index).types.astype(str).tolist()
        )

    def spread(self, count: int) -> Int:
        """Return the numbers of some frames, evenly spread, all of them where they are fewer."""
        return np.linspace(0, len(self) - 1, min(len(self), count)).round().astype(np.int64)

    def name(self, number: int) -> str:
        """Return the name of a frame in results."""
        drive, index = self._frames[number]
        return frame_name(drive, index)

    def place(self, number: int) -> tuple[Drive, int]:
        """Return the drive of a frame, and the frame's index in it."""
        return self._frames[number]

    def cached(
        self, number: int, what: str, settings: dict[str, Any], compute: Callable[[Frame], Arrays]
    ) -> Arrays:
        """Return arrays computed from a frame, from the cache where it has them.

        Args:
            number: Number of the frame.
            what: Name of the arrays in the key.
            settings: All that determines them beside the frame: numbers, texts, and the code's fingerprint.
            compute: Function from the frame to the arrays.

        Raises:
            PerceptionError: a file of the frame cannot be read, or it lacks the image or the calibration.
        """
        drive, index = self._frames[number]
        key = self._key(number, what, settings)
        return self.store.get(key, lambda: compute(drive[index]))

    def _key(self, number: int, what: str, settings: dict[str, Any]) -> str:
        """Return the key of arrays in the cache."""
        drive, index = self._frames[number]
        if (number, what) not in self._keys:
            key = entry_key(what=what, **settings, **frame_fingerprint(drive, index))
            self._keys[number, what] = key
        return self._keys[number, what]

    @abstractmethod
    def keys(self, number: int) -> Sequence[str]:
        """Return the keys of all arrays of a frame."""

    @abstractmethod
    def make(self, number: int) -> None:
        """Make all arrays of a frame that are not cached.

        Raises:
            PerceptionError: as `cached`.
        """

    def missing(self) -> list[int]:
        """Return the numbers of the frames of which an array is not cached; of frames that are named often the last."""
        number_of = {tuple(self.keys(number)): number for number in range(len(self))}
        return [
            number
            for keys, number in number_of.items()
            if any(key not in self.store for key in keys)
        ]

    def fill(self, numbers: Sequence[int]) -> None:
        """Make the arrays of some frames; who needs those of a faulty one meets the fault again."""
        for number in numbers:
            with suppress(PerceptionError):
                self.make(number)
