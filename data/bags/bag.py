"""One bag: its topics, and its messages in the order in which they were recorded."""

import threading
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from perception.errors import DriveError, PerceptionError, optional_package

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

Value = TypeVar("Value")

_REPAIRS = {
    ".bag": "rosbag reindex FILE repairs a bag that was cut off",
    ".mcap": "mcap recover FILE -o REPAIRED.mcap repairs a file that was cut off",
    ".db3": "copy the file again, it may be cut off; sqlite3 FILE .recover saves what is left",
}


@dataclass(frozen=True)
class BagTopic:
    """A topic of a bag.

    Attributes:
        name: Name, such as /velodyne_points.
        kind: Type of its messages, such as sensor_msgs/msg/PointCloud2.
        count: Number of its messages.
    """

    name: str
    kind: str
    count: int


@dataclass(frozen=True)
class RawMessage:
    """A message as it was recorded.

    Attributes:
        topic: Name of its topic.
        received_ns: Time at which it was recorded, in ns.
        data: Its bytes.
    """

    topic: str
    received_ns: int
    data: bytes


class Bag:
    """A bag that is opened at its first use; it may be read from several threads, each call of `messages` in one."""

    def __init__(self, path: Path) -> None:
        """Remember the path: a .bag, .mcap or .db3 file, or a folder with metadata.yaml."""
        self.path = path
        self.lock = threading.RLock()
        self._readers: dict[frozenset[str], AnyReader] = {}

    def __reduce__(self) -> tuple[type["Bag"], tuple[Path]]:
        """Open the bag again in another process."""
        return Bag, (self.path,)

    @property
    def is_ros1(self) -> bool:
        """Whether messages are encoded as ROS 1 does."""
        return self.path.suffix == ".bag"

    @cached_property
    def _shares_position(self) -> bool:
        """Whether two topics that are read in turn would disturb each other, as in an MCAP file without chunks."""
        return any(path.suffix == ".mcap" for path in self.files)

    @property
    def files(self) -> list[Path]:
        """Files of the bag."""
        return sorted(self.path.iterdir()) if self.path.is_dir() else [self.path]

    @cached_property
    def topics(self) -> tuple[BagTopic, ...]:
        """Topics by name.

        Raises:
            DriveError: The bag cannot be read.
            MissingDependencyError: rosbags is not installed.
        """
        with self.errors():
            counts: Counter[tuple[str, str]] = Counter()
            for connection in self._reader.connections:
                name = _checked(connection.topic, str, "a topic named")
                kind = _checked(connection.msgtype, str, f"messages of {name} of type")
                counts[name, kind] += connection.msgcount
        return tuple(BagTopic(*names, count) for names, count in sorted(counts.items()))

    @cached_property
    def kinds(self) -> dict[str, str]:
        """Type of the messages of each topic."""
        return {topic.name: topic.kind for topic in self.topics}

    def messages(
        self, topics: Collection[str], start_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """Yield the messages of some topics in the order of recording, from a time of recording on.

        Raises:
            DriveError: The bag is damaged.
        """
        reader = self._reader_of(frozenset(topics)) if self._shares_position else self._reader
        with self.errors():
            chosen = [one for one in reader.connections if one.topic in topics]
            if not chosen:  # none would mean all
                return
            for connection, received_ns, data in reader.messages(chosen, start=start_ns):
                at_ns = _checked(received_ns, int, f"a message of {connection.topic} at")
                contents = _checked(
                    data, (bytes, memoryview), f"a message of {connection.topic} with"
                )
                yield RawMessage(connection.topic, at_ns, bytes(contents))

    def decode(self, message: RawMessage) -> Any:  # noqa: ANN401 - the classes are made from the bag's own definitions
        """Return the fields of a message.

        Raises:
            DriveError: Its bytes are not those of its type.
        """
        kind = self.kinds[message.topic]
        where = f"{self.path} {message.topic} at {message.received_ns / 1e9:.3f} s"
        with self.errors(where, f"a message of type {kind}"), self.lock:
            return self._reader.deserialize(message.data, kind)

    @cached_property
    def _reader(self) -> "AnyReader":
        return self._open()

    def _reader_of(self, topics: frozenset[str]) -> "AnyReader":
        """Return the reader of some topics alone, which is opened once."""
        if topics not in self._readers:
            self._readers[topics] = self._open()
        return self._readers[topics]

    def _open(self) -> "AnyReader":
        with optional_package("rosbags", needed_for=str(self.path), extra="bags"):
            from rosbags.highlevel import AnyReader
            from rosbags.typesys import Stores, get_typestore
        with self.errors():
            # Bags of older distributions do not hold the definitions of their messages.
            reader = AnyReader([self.path], default_typestore=get_typestore(Stores.LATEST))
            reader.open()
        return reader

    @contextmanager
    def errors(self, where: str | None = None, expected: str = "a whole bag") -> Iterator[None]:
        """Turn whatever goes wrong in reading the bag into one sentence.

        Raises:
            DriveError: Anything else than an error of ours was raised.
        """
        try:
            yield
        # A damaged bag breaks the libraries below in any way: struct, sqlite, zstd, key and index errors.
        except (PerceptionError, GeneratorExit):
            raise
        except Exception as error:
            suffix = next((file.suffix for file in self.files if file.suffix in _REPAIRS), "")
            raise DriveError(
                where or self.path,
                expected=expected,
                found=_first_line(error),
                advice=_REPAIRS.get(suffix) if where is None else None,
            ) from error


def _checked(value: Value, kind: type | tuple[type, ...], what: str) -> Value:
    """Return a value of a bag; a database may hold one of any type in every place."""
    if not isinstance(value, kind):
        raise TypeError(f"{what} {value!r:.40}")
    return value


# Decodes the bytes of one message, or looks at them.
MessageVisitor = Callable[[RawMessage], object]


def _first_line(error: Exception) -> str:
    lines = str(error).splitlines() or [""]
    return lines[0].rstrip(".") or type(error).__name__
