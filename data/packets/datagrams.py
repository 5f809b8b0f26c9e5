"""UDP datagrams of a capture by sender, with their places in the file."""

import mmap
from array import array
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from functools import lru_cache
from ipaddress import ip_address
from pathlib import Path
from typing import NamedTuple

Data = bytes | mmap.mmap
_MAX_AWAITED = 64  # datagrams of which fragments are still to come


class Sender(NamedTuple):
    """Address and port that datagrams come from, and the port they go to: one kind of packets of one sensor."""

    address: bytes
    source_port: int
    port: int

    def __str__(self) -> str:
        address = ip_address(self.address)
        return f"{address}:{self.port}" if address.version == 4 else f"[{address}]:{self.port}"

    def is_named(self, name: str) -> bool:
        """Return whether a name is the address, a port, or both."""
        return name in {
            str(ip_address(self.address)),
            *(str(port) for port in self[1:]),
            *(str(self._replace(port=port)) for port in (self.source_port, self.port)),
        }


@dataclass
class Datagrams:
    """Datagrams of one sender: each has a time and some pieces, each piece a start and an end in the file."""

    times_ns: "array[int]" = field(default_factory=lambda: array("q"))
    pieces_end: "array[int]" = field(default_factory=lambda: array("q"))
    places: "array[int]" = field(default_factory=lambda: array("q"))
    lengths: Counter[int] = field(default_factory=Counter)

    def __len__(self) -> int:
        return len(self.times_ns)

    def add(self, time_ns: int, pieces: list[tuple[int, int]]) -> None:
        """Add a datagram."""
        self.times_ns.append(time_ns)
        for piece in pieces:
            self.places.extend(piece)
        self.pieces_end.append(len(self.places))
        self.lengths[sum(end - start for start, end in pieces)] += 1

    def read(self, index: int, data: Data) -> bytes:
        """Return the bytes of one datagram."""
        first = self.pieces_end[index - 1] if index else 0
        places = self.places[first : self.pieces_end[index]]
        return b"".join(data[a:b] for a, b in zip(places[::2], places[1::2], strict=True))


class Fragments:
    """Joins the fragments in which IP carries large datagrams, in any order."""

    def __init__(self) -> None:
        self._awaited: dict[bytes, dict[int, tuple[int, int, bool]]] = {}

    def join(
        self, key: bytes, offset: int, piece: tuple[int, int], *, is_last: bool
    ) -> list[tuple[int, int]]:
        """Return the pieces of the datagram that a fragment completes; none where others are awaited.

        Args:
            key: Sender and number of the datagram.
            offset: Place of the fragment within it.
            piece: Start and end of the fragment in the file.
            is_last: Whether no fragment lies behind it.
        """
        parts = self._awaited.pop(key, {})
        if offset in parts:  # of an earlier datagram of this number
            parts = {}
        parts[offset] = (*piece, is_last)
        pieces = [parts[one] for one in sorted(parts)]
        start, end, has_end = pieces[-1]
        if has_end and sum(b - a for a, b, _ in pieces) == max(parts) + end - start:
            return [(a, b) for a, b, _ in pieces]
        self._awaited[key] = parts
        if len(self._awaited) > _MAX_AWAITED:
            del self._awaited[next(iter(self._awaited))]
        return []


@dataclass
class Capture:
    """What a capture holds.

    Attributes:
        path: File.
        senders: Datagrams by sender.
        others: Number of packets that are no whole datagram, by what they are.
        is_cut: Whether the file ends within a packet.
    """

    path: Path
    senders: defaultdict[Sender, Datagrams] = field(default_factory=lambda: defaultdict(Datagrams))
    others: Counter[str] = field(default_factory=Counter)
    is_cut: bool = False


def file_bytes(path: Path) -> Data:
    """Return the bytes of a file, which are read where they are used."""
    state = path.stat()
    return _mapped(path, state.st_size, state.st_mtime_ns)


@lru_cache(maxsize=4)
def _mapped(path: Path, size: int, _: int) -> Data:
    with path.open("rb") as file:
        return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) if size else b""
