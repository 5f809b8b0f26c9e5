"""The drives that a batch is given: folders, globs and lists of them, and a name for the results of each."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from glob import glob
from pathlib import Path

from data.open_drive import sequences_in
from data.remote_folder import RemoteFolder, is_url
from data.results.folder import CONFIG
from perception.errors import DriveError

log = logging.getLogger(__name__)

_EXPECTED = "a drive, a glob of drives, or a list"


@dataclass(frozen=True)
class DriveSource:
    """A drive that a batch was given.

    Attributes:
        root: Folder or file of the drive, or of all sequences; of one at a URL, the path there.
        sequence: Name of the sequence, where the root holds several.
        url: URL of the drive, from which its worker fetches it; empty where it lies in a folder.
    """

    root: Path
    sequence: str | None
    url: str = ""

    @property
    def name(self) -> str:
        """Name of the drive."""
        return self.sequence or self.root.name


def find_drives(patterns: Sequence[str]) -> list[DriveSource]:
    """Return every drive of folders, URLs, globs of these, and list files, which hold one of these a line.

    Paths become absolute. What is at a URL is one drive: nothing of it is read before its worker fetches it.

    Raises:
        DriveError: A pattern matches no path, or a path holds no drive.
        UsageError: There is no such kind of URL, or its package is not installed.
    """
    found = [source for pattern in patterns for source in _sources(pattern)]
    if not found:
        raise DriveError(" ".join(patterns), expected=_EXPECTED, found="none")
    return found


def chunks(count: int, start: int, frames: int | None, size: int, every: int = 1) -> list[range]:
    """Return the indices of frames in chunks, the last one shorter.

    Args:
        count: Number of frames of the drive.
        start: Number of frames at its start that are left out.
        frames: Number of frames from there, or None for all.
        size: Number of frames of a chunk.
        every: Step from frame to frame.
    """
    end = count if frames is None else min(count, start + every * frames)
    firsts = range(start, end, every * size)
    return [range(first, min(first + every * size, end), every) for first in firsts]


def _sources(pattern: str) -> list[DriveSource]:
    if is_url(pattern):
        found = [
            DriveSource(Path(f"/{url.partition('://')[2]}"), None, url)
            for url in RemoteFolder(pattern).matches()
        ]
    else:
        path = Path(pattern)
        if path.suffix == ".txt" and path.is_file():
            lines = path.read_text().splitlines()
            named = [line.strip() for line in lines if line.strip() and not line.startswith("#")]
            return find_drives(named)
        # Path.glob takes no absolute pattern.
        paths = [path] if path.exists() else [Path(name) for name in sorted(glob(pattern))]  # noqa: PTH207
        roots = [one.absolute() for one in paths]
        # A command writes its configuration beside the drives.
        if left_out := [root for root in roots if root.name == CONFIG and root.is_file()]:
            log.warning("%s: left out, it is the configuration of a command", left_out[0])
        drives = [root for root in roots if root not in left_out]
        found = [DriveSource(root, name) for root in drives for name in sequences_in(root)]
        if left_out and not found:
            return []
    if not found:
        raise DriveError(pattern, expected=_EXPECTED, found="no path")
    return found


def folder_names(sources: Sequence[DriveSource]) -> list[str]:
    """Return a name for the results of each drive; those of the same name get the folder of their root before it."""
    plain = [source.name for source in sources]
    names = [
        name if plain.count(name) == 1 else f"{source.root.resolve().parent.name}-{name}"
        for source, name in zip(sources, plain, strict=True)
    ]
    return [
        name if names.count(name) == 1 else f"{name}-{names[: n + 1].count(name)}"
        for n, name in enumerate(names)
    ]
