"""Counts of a search in a file from which an interrupted search continues.

The first row states what is searched; each other row is what one setting reaches in one chunk:

    {"search": {"drives": [...], "of_class": "Car", "overlaps": [0.7, 0.5], ...}}
    {"chunk": 0, "parameters": {"cell_m": 0.5, ...}, "frames": 20, "unread": 0, "objects": 61, "reached": [30, 47], "proposals": 512}

A row counts once it ends in a line break. It depends on its own setting alone, so that a
search over more values continues from one over fewer.
"""

import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from perception.atomic_file import append_atomically, write_atomically
from perception.detection.config import ProposalConfig
from perception.errors import UsageError
from train.proposal_search.counting import ProposalCount, SearchTask

Key = tuple[int, ProposalConfig]


class SearchLog:
    """Counts by chunk and setting, in memory and in the file."""

    def __init__(self, path: Path, search: dict[str, Any]) -> None:
        """Read what there is; the file is written with the first counts.

        Args:
            path: File of the counts.
            search: All that the counts depend on beside chunk and setting, as JSON types.

        Raises:
            UsageError: the file is of another search, or none of this kind.
        """
        self.path = path
        self.counts: dict[Key, ProposalCount] = {}
        self._first_row = _row({"search": search})
        lines = _whole_lines(path)
        if not lines:
            return
        self._require_same(lines[0], search)
        for number, line in enumerate(lines[1:], start=2):
            self._read(number, line)

    def holds(self, part: SearchTask) -> bool:
        """Return whether every setting of a part is counted."""
        return all((part.chunk, parameters) in self.counts for parameters in part.parameters)

    def add(self, chunk: int, counts: Iterable[ProposalCount]) -> None:
        """Write what a part came to, at once."""
        counts = list(counts)
        rows = b"".join(_row({"chunk": chunk, **asdict(count)}) for count in counts)
        is_new = not self.path.exists()
        append_atomically(self.path, self._first_row + rows if is_new else rows)
        self.counts.update({(chunk, count.parameters): count for count in counts})

    def _require_same(self, line: bytes, search: dict[str, Any]) -> None:
        found = _parse(line).get("search")
        if found == search:
            return
        if not isinstance(found, dict):
            raise UsageError(self.path, expected="the counts of a search", found="something else")
        names = search | found
        other = [name for name in names if found.get(name) != search.get(name)]
        raise UsageError(
            self.path,
            expected="counts of this search, to go on from",
            found=f"those of another, by its {' and '.join(other)}",
            advice="choose another --out, or remove the file",
        )

    def _read(self, number: int, line: bytes) -> None:
        row = _parse(line)
        try:
            chunk = int(row["chunk"])
            count = ProposalCount(
                parameters=ProposalConfig(**row["parameters"]),
                reached=tuple(map(int, row["reached"])),
                **{name: int(row[name]) for name in ("frames", "unread", "objects", "proposals")},
            )
        except (KeyError, TypeError, ValueError) as error:
            raise UsageError(
                f"{self.path} row {number}",
                expected="the counts of one setting in one chunk",
                found=repr(line[:60].decode(errors="replace")),
                advice="remove the row, and it is counted again",
            ) from error
        self.counts[chunk, count.parameters] = count


def _whole_lines(path: Path) -> list[bytes]:
    """Return the rows of a file; a last one that was not finished is cut off the file."""
    if not path.exists():
        return []
    try:
        content = path.read_bytes()
        whole, _, rest = content.rpartition(b"\n")
        if rest:
            write_atomically(path, content[: len(content) - len(rest)])
    except OSError as error:
        raise UsageError(path, expected="a file of counts", found=str(error)) from error
    return whole.splitlines()


def _row(document: dict[str, Any]) -> bytes:
    return json.dumps(document).encode() + b"\n"


def _parse(line: bytes) -> dict[str, Any]:
    """Return the object of a row; an empty one where it is none."""
    try:
        row = json.loads(line)
    except ValueError:
        return {}
    return row if isinstance(row, dict) else {}
