"""A disk without room: by a limit, which needs no privileges, or a real small one."""

import resource
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path


@contextmanager
def file_size_limit(size: int) -> Iterator[None]:
    """Let no file of this process grow beyond a size in bytes, as on a disk that is full."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@dataclass(frozen=True)
class SmallDisk:
    """A file system of few bytes, in memory.

    Attributes:
        path: Folder at which it is mounted.
    """

    path: Path

    @classmethod
    @contextmanager
    def mounted(cls, path: Path, size: str) -> Iterator["SmallDisk | None"]:
        """Mount it at an empty folder; None where that is not allowed."""
        command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(path)]
        try:
            is_mounted = subprocess.run(command, capture_output=True, check=False).returncode == 0
        except OSError:  # no such program
            is_mounted = False
        try:
            yield cls(path) if is_mounted else None
        finally:
            if is_mounted:
                subprocess.run(["umount", str(path)], check=True)

    def resize(self, size: str) -> None:
        """Give it another size."""
        subprocess.run(["mount", "-o", f"remount,size={size}", str(self.path)], check=True)
