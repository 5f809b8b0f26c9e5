"""Frames that a network learned from, known by the contents of their scans, as its model file states them."""

import binascii
from base64 import b64decode, b64encode
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from data.recorded_drive import RecordedDrive
from perception.errors import ModelError
from perception.types import Bool

ENTRY = "training_frames"  # of a model file's metadata
UNKNOWN = "unknown"  # of weights that were trained further
_BYTES = 8  # for 4489 frames, 48 KB of text


@dataclass(frozen=True)
class TrainingFrames:
    """Frames by a hash of the scan: neither the name nor the folder of a copy matters.

    Attributes:
        hashes: Hash of each scan.
    """

    hashes: frozenset[bytes]

    @classmethod
    def of(cls, drives: Iterable[RecordedDrive]) -> Self:
        """Return all frames of some drives."""
        return cls(frozenset(one for drive in drives for one in scan_hashes(drive)))

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, str], file: str) -> Self | None:
        """Return the frames that a model file states, or None where it does not know them.

        Raises:
            ModelError: The entry is damaged.
        """
        if metadata.get(ENTRY, UNKNOWN) == UNKNOWN:
            return None
        try:
            data = b64decode(metadata[ENTRY], validate=True)
        except binascii.Error as error:
            raise ModelError(
                file, expected=f"{ENTRY} in base64", found=f"another text ({error})"
            ) from error
        return cls(frozenset(data[i : i + _BYTES] for i in range(0, len(data), _BYTES)))

    @property
    def text(self) -> str:
        """Hashes in rising order, in base64."""
        return b64encode(b"".join(sorted(self.hashes))).decode()

    def joined(self, others: Self) -> Self:
        """Return these frames and others."""
        return replace(self, hashes=self.hashes | others.hashes)

    def among(self, hashes: Sequence[bytes]) -> Bool:
        """Return the (F,) mask of those of F frames that are among these."""
        return np.array([one in self.hashes for one in hashes], bool)


def scan_hashes(drive: RecordedDrive) -> list[bytes]:
    """Return the hash of the scan of each of the F frames of a drive."""
    with ThreadPoolExecutor() as readers:
        return list(readers.map(drive.fingerprint, range(len(drive))))
