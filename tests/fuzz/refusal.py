"""What a parser does with a file: reads it, or refuses it in one sentence."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from perception.errors import PerceptionError
from tests.fuzz.parsers import FileParser


def place(parser: FileParser, folder: Path) -> Path:
    """Write the files that the parser reads beside its own; return the path of its own."""
    path = folder / parser.file
    path.parent.mkdir(parents=True, exist_ok=True)
    for name, content in parser.beside.items():
        (folder / name).write_bytes(content())
    return path


def refusal(parser: FileParser, path: Path, data: bytes) -> str | None:
    """Return the sentence with which a parser refuses a file, or None where it reads it.

    Any other exception passes: it is the fault that is looked for.
    """
    path.write_bytes(data)
    try:
        parser.read(path)
    except PerceptionError as error:
        sentence = str(error)
        if "\n" in sentence:
            raise AssertionError(f"more than one line: {sentence!r}") from error
        return sentence
    return None


@contextmanager
def memory_bound(max_bytes: int) -> Iterator[None]:
    """Fail where the memory of this process has grown by more than a bound at any time within the block.

    Linux alone keeps the peak of a part of a run; elsewhere nothing is bounded.
    """
    before = _reset_peak_bytes()
    yield
    if before is not None:
        grown = _peak_bytes() - before
        assert grown <= max_bytes, f"{grown >> 20} MiB of memory, at most {max_bytes >> 20} allowed"


def _reset_peak_bytes() -> int | None:
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return None
    return _peak_bytes()


def _peak_bytes() -> int:
    status = Path("/proc/self/status").read_text()
    (row,) = (line for line in status.splitlines() if line.startswith("VmHWM:"))
    return int(row.split()[1]) << 10
