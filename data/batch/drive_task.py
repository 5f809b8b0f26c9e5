"""One command line of a batch: what identifies it, where its results go, and what became of it."""

import hashlib
import json
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from data.frame_fingerprint import frame_fingerprint
from data.open_drive import open_drive
from data.remote_folder import RemoteFolder
from data.results.records import read_record
from perception import __version__
from perception.atomic_file import write_atomically
from perception.errors import LabelError, PerceptionError

State = Literal["done", "skipped", "failed"]
_RECORD = "batch.json"
_FOLDER = "drives"


@dataclass(frozen=True)
class DriveOutcome:
    """What became of a drive.

    Attributes:
        name: Name of its folder of results.
        state: Done now, skipped as it was done before, or failed.
        frames: Number of its frames.
        seconds: Time that its worker took.
        key: Hash of what the results depend on.
        error: Sentence of the error that ended it, or empty.
    """

    name: str
    state: State
    frames: int
    seconds: float
    key: str
    error: str = ""


@dataclass(frozen=True)
class Task(ABC):
    """A command line that is done once.

    Attributes:
        name: Name of the folder of results, unique in the batch.
        words: Words of the command line, what it reads and writes included.
        folder: Folder of the results.
        settings: Text of the effective configuration.
    """

    name: str
    words: tuple[str, ...]
    folder: Path
    settings: str

    @property
    def record(self) -> Path:
        """File that is written when the results are whole."""
        return self.folder / _RECORD

    @abstractmethod
    def inputs(self) -> tuple[object, int]:
        """Return as JSON what identifies the files that are read, and the number of frames.

        Raises:
            PerceptionError: They cannot be opened.
        """

    def key(self) -> tuple[str, int]:
        """Return a hash of the inputs, the configuration and the version, and the number of frames.

        Raises:
            PerceptionError: The inputs cannot be opened.
        """
        inputs, frames = self.inputs()
        content = json.dumps([__version__, self.settings, inputs], default=str)
        return hashlib.blake2b(content.encode(), digest_size=16).hexdigest(), frames

    @contextmanager
    def ready(self, frames: int) -> Iterator[tuple[tuple[str, ...], int]]:
        """Make what is read ready for as long as the `with` lasts; return the words of the command and the frames.

        Args:
            frames: Number of frames, as `key` returns it.

        Raises:
            PerceptionError: The inputs cannot be fetched.
        """
        yield self.words, frames

    def finished(self, key: str) -> DriveOutcome | None:
        """Return the outcome of an earlier batch that the same inputs led to."""
        if not self.record.is_file():
            return None
        try:
            outcome = read_record(self.record, DriveOutcome)
        except LabelError:
            return None  # of another version, or damaged: done again
        return outcome if outcome.key == key else None

    def finish(self, outcome: DriveOutcome) -> None:
        """Remember that the results are whole."""
        write_atomically(self.record, json.dumps(vars(outcome)).encode())


@dataclass(frozen=True)
class DriveTask(Task):
    """A command on a drive.

    Attributes:
        root: Folder or file of the drive, or of all sequences.
        sequence: Name of the sequence, where the root holds several.
        chunk: Indices of the frames, where the command takes a part of the drive; else all.
    """

    root: Path
    sequence: str | None
    chunk: range | None = None

    def inputs(self) -> tuple[object, int]:
        """Return names, sizes and times of the files; reading a fleet's scans twice would take hours."""
        drive = open_drive(self.root, sequence=self.sequence)
        indices = self.chunk or range(len(drive))
        return [frame_fingerprint(drive, index) for index in indices], len(indices)


@dataclass(frozen=True)
class RemoteDriveTask(Task):
    """A command on a drive at a URL, which is fetched for as long as the command runs.

    Attributes:
        url: URL of the drive; the word of the command in its place.
    """

    url: str

    def inputs(self) -> tuple[object, int]:
        """Return names, sizes and versions of the files; the number of frames is known when they are here."""
        return RemoteFolder(self.url).listing(), 0

    @contextmanager
    def ready(self, frames: int) -> Iterator[tuple[tuple[str, ...], int]]:
        """Fetch the drive into a temporary folder, which the words name in place of the URL."""
        with tempfile.TemporaryDirectory(prefix="trifuse-") as folder:
            root = Path(folder) / self.url.rpartition("/")[2]
            RemoteFolder(self.url).fetch(root)
            words = tuple(str(root) if word == self.url else word for word in self.words)
            yield words, len(open_drive(root))


@dataclass(frozen=True)
class SynthTask(Task):
    """A part of synthetic drives, which reads no files.

    Attributes:
        frames: Number of its frames.
    """

    frames: int

    def inputs(self) -> tuple[object, int]:
        """Return the words of the part."""
        return self.words, self.frames


def results_folder(out: Path, name: str) -> Path:
    """Return the folder of the results of a drive in that of a batch."""
    return out / _FOLDER / name


def sentence_of(error: Exception) -> str:
    """Return one line that says what ended a drive."""
    text = str(error) if isinstance(error, PerceptionError) else repr(error)
    return " ".join(text.split())
