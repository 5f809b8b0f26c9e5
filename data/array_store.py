"""Arrays that take long to make, kept on disk: made once, read by memory map, and bounded in bytes.

    folder/3f9a.../picture.npy          one entry: a folder named by the key, a file an array
                  /labels.npy
    folder/.part-.../                   an entry that a process is writing; renamed when it is whole

It is a cache. What it holds can be made again, so that any part of it may be deleted at any time, and an
entry that is missing, damaged or gone is computed again.
"""

import errno
import hashlib
import json
import logging
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perception.errors import UsageError

log = logging.getLogger(__name__)

Arrays = Mapping[str, NDArray[Any]]

_PART = ".part-"
_ABANDONED_S = 3600.0  # a part as old as this is of a process that died
_MAPPED_BYTES = 1 << 16  # smaller arrays are read outright: a map costs a file handle
# What NumPy raises of a damaged file; it parses the header as Python.
_DAMAGED = (ValueError, EOFError, SyntaxError, TokenError, TypeError, MemoryError)
_RESCAN_SHARE = 0.02  # share of the budget that is written between two scans of the whole folder


def default_folder() -> Path:
    """Return the cache folder of the user's system."""
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "trifuse" / "arrays"


def entry_key(**metadata: object) -> str:
    """Return the name of an entry by all that makes it: numbers, texts, paths, lists and dicts."""
    text = json.dumps(metadata, sort_keys=True, default=os.fspath)
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


class ArrayStore:
    """Entries of named arrays by key; any number of processes may use one folder at once."""

    def __init__(self, folder: Path | None = None, budget_bytes: int = 20 * 10**9) -> None:
        """Open or make the folder.

        Args:
            folder: Folder; else the user's cache folder.
            budget_bytes: Size in bytes, beyond which the least recently used entries are deleted.

        Raises:
            UsageError: the folder cannot be written to, or the budget is not above zero.
        """
        self.folder = default_folder() if folder is None else folder
        self.budget_bytes = budget_bytes
        self._unscanned_bytes = (
            budget_bytes  # so that the first entry triggers a scan of the folder
        )
        if budget_bytes <= 0:
            found = f"{budget_bytes} bytes"
            raise UsageError("budget of the cache", expected="above zero", found=found)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise self._cannot_write(error) from error

    def get(self, key: str, make: Callable[[], Arrays]) -> Arrays:
        """Return the arrays of a key, large ones by memory map; make them where they are not there.

        Raises:
            UsageError: the folder cannot be written to.
        """
        entry = self.folder / key
        try:
            arrays = _load(entry)
            os.utime(entry)  # it was used now
        except FileNotFoundError:
            return self._added(entry, make())
        except (OSError, *_DAMAGED) as error:
            log.warning("replaced the damaged cache entry %s: %s", entry, error)
            self._discard(entry)
            return self._added(entry, make())
        return arrays

    def __contains__(self, key: str) -> bool:
        return (self.folder / key).is_dir()

    def _added(self, entry: Path, arrays: Arrays) -> Arrays:
        """Write an entry whole, or leave the one that another process was faster to write."""
        try:
            self._unscanned_bytes += self._write(entry, arrays)
        except OSError as error:
            raise self._cannot_write(error) from error
        if self._unscanned_bytes > _RESCAN_SHARE * self.budget_bytes:
            self._keep_to_budget(entry)
        return arrays

    def _write(self, entry: Path, arrays: Arrays) -> int:
        """Write the arrays beside the entry and rename them; return how many bytes they take."""
        part = Path(tempfile.mkdtemp(prefix=_PART, dir=self.folder))
        try:
            for name, array in arrays.items():
                np.save(part / f"{name}.npy", array, allow_pickle=False)
            size_bytes = _size_bytes(part)
            part.rename(entry)
        except OSError as error:
            shutil.rmtree(part, ignore_errors=True)
            if error.errno not in (errno.EEXIST, errno.ENOTEMPTY):
                raise
            return 0  # another process was faster
        return size_bytes

    def _keep_to_budget(self, newest: Path) -> None:
        """Delete what was unused for the longest time, and what dead processes left."""
        folders = sorted((_used_s(path), path) for path in self.folder.iterdir() if path.is_dir())
        sizes = {path: _size_bytes(path) for _, path in folders}
        excess = sum(sizes.values()) - self.budget_bytes
        for used_s, path in folders:
            if path.name.startswith(_PART):
                is_to_go = time.time() - used_s > _ABANDONED_S
            else:
                is_to_go = excess > 0 and path != newest
            if is_to_go:
                self._discard(path)
                excess -= sizes[path]
        self._unscanned_bytes = 0

    def _discard(self, path: Path) -> None:
        """Delete an entry so that no process ever sees half of it."""
        with suppress(OSError):
            part = path.rename(self.folder / f"{_PART}{os.getpid()}-{path.name}")
            shutil.rmtree(part, ignore_errors=True)

    def _cannot_write(self, error: OSError) -> UsageError:
        return UsageError(
            f"cache folder {self.folder}",
            expected="a folder with room to write to",
            found=error.strerror or str(error),
            advice="choose another folder with --cache, or make room",
        )


def _load(entry: Path) -> Arrays:
    """Open the arrays of an entry.

    Raises:
        FileNotFoundError: there is no such entry.
        OSError, or another of `_DAMAGED`: it is damaged.
    """
    arrays = {path.stem: _open(path) for path in entry.iterdir()}
    if not arrays:
        raise ValueError("it holds nothing")
    return arrays


def _open(path: Path) -> NDArray[Any]:
    is_large = path.stat().st_size > _MAPPED_BYTES
    array: NDArray[Any] = np.load(path, mmap_mode="r" if is_large else None, allow_pickle=False)
    return array


def _used_s(path: Path) -> float:
    """Return when a folder was used last; one that has just gone is the oldest."""
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def _size_bytes(folder: Path) -> int:
    """Return what the files of a folder take; those that have just gone take nothing."""
    try:
        return sum(path.stat().st_size for path in folder.iterdir())
    except OSError:
        return 0
