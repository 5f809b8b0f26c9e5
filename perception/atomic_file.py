"""Files that are written whole or not at all; a full or read-only disk is one sentence."""

import errno
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from perception.errors import WriteError

if TYPE_CHECKING:  # the command line checks its outputs before NumPy is loaded
    from perception.types import UInt8

_NO_ROOM = "make room and run it again; the files that were complete are kept"
_NOT_ALLOWED = "choose a folder that you may write to; the files that were complete are kept"
_ADVICE: Mapping[int | None, str] = {
    **dict.fromkeys((errno.ENOSPC, errno.EDQUOT, errno.EFBIG), _NO_ROOM),
    **dict.fromkeys((errno.EACCES, errno.EPERM, errno.EROFS), _NOT_ALLOWED),
}


@contextmanager
def writing(path: str | Path) -> Iterator[None]:
    """Name the file in the errors of the operating system while it is written.

    Args:
        path: File or folder that is written.

    Raises:
        WriteError: It cannot be written.
    """
    try:
        yield
    except OSError as error:
        raise write_error(path, error) from error


def write_error(path: str | Path, error: OSError) -> WriteError:
    """Return an error of the operating system as a sentence."""
    return WriteError(
        path,
        expected="a place that can be written to",
        found=error.strerror or str(error),
        advice=_ADVICE.get(error.errno, "choose another path"),
    )


def require_writable(path: Path) -> None:
    """Validate, before the work, that a file can be written after it.

    Raises:
        WriteError: It cannot, or there is a folder of that name.
    """
    parent = next(one for one in path.absolute().parents if one.exists())
    number = errno.EISDIR if path.is_dir() else 0
    if not parent.is_dir():
        number = errno.ENOTDIR
    elif not os.access(parent, os.W_OK):
        number = errno.EACCES
    if number:
        raise write_error(path, OSError(number, os.strerror(number)))


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Yield the path of a partial file, which takes the place of the whole one at the end; make its folder.

    Where something goes wrong, the partial file is removed and an older file stays. Processes may write the same file at the
    same time: each has a partial file, and the last whole one stays.

    Args:
        path: Path of the whole file; the partial one has the same suffix.

    Raises:
        WriteError: The file cannot be written.
    """
    part = part_of(path, str(os.getpid()))
    with writing(path):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            yield part
            part.replace(path)
        except BaseException:
            with suppress(OSError):
                part.unlink(missing_ok=True)
            raise


def part_of(path: Path, process: str = "") -> Path:
    """Return the path of the partial file of a file, or of a pattern of files; of one process, or of all ("*")."""
    return path.with_name(f".{path.stem}.part{process}{path.suffix}")


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file whole or not at all; make its folder."""
    with atomic_file(path) as part:
        part.write_bytes(data)


def append_atomically(path: Path, data: bytes) -> None:
    """Append to a file all of the data or nothing; make its folder and the file."""
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        size = path.stat().st_size if path.exists() else 0
        try:
            with path.open("ab") as file:
                file.write(data)
        except OSError:
            with suppress(OSError):
                os.truncate(path, size)
            raise


def write_jpeg(path: Path, image: "UInt8", quality: int = 90) -> None:
    """Write an (H, W, 3) RGB image atomically as JPEG."""
    import cv2

    _, encoded = cv2.imencode(".jpg", image[:, :, ::-1], (cv2.IMWRITE_JPEG_QUALITY, quality))
    write_atomically(path, encoded.tobytes())
