"""When the messages of a topic were measured and recorded: 16 bytes a message, whatever its size."""

import logging
import struct
from array import array
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from data.bags.bag import Bag, MessageVisitor, RawMessage
from perception.errors import DriveError

log = logging.getLogger(__name__)

Nanoseconds = NDArray[np.int64]

_OTHER_CLOCK_NS = 1_000_000_000  # no message is recorded so long after it was measured
_HEADER_BYTES = 12
_LONG_BAG_BYTES = 20_000_000_000  # reading it once takes a minute or more


@dataclass(frozen=True)
class MessageTimes:
    """Times of the M messages of one topic, in the order of the stamps.

    Attributes:
        stamps_ns: (M,) stamps of the headers: when each was measured.
        received_ns: (M,) when each was recorded.
        ordinals: (M,) number of the message among those of the topic that were recorded at the same time.
    """

    stamps_ns: Nanoseconds
    received_ns: Nanoseconds
    ordinals: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @property
    def delay_ns(self) -> int:
        """Median time from the stamp to the recording."""
        # A mean of two would be a floating-point number, of too few digits for ns since 1970.
        return int(np.sort(self.received_ns - self.stamps_ns)[len(self) // 2])

    def by_clock_of(self, other: "MessageTimes") -> "MessageTimes":
        """Return the stamps by the clock of another topic, where they are seconds apart, else as they are."""
        if not (len(self) and len(other)):
            return self
        shift_ns = self.delay_ns - other.delay_ns
        if abs(shift_ns) < _OTHER_CLOCK_NS:
            return self
        return MessageTimes(self.stamps_ns + shift_ns, self.received_ns, self.ordinals)


def read_times(
    bag: Bag, topics: tuple[str, ...], visitors: Mapping[str, MessageVisitor]
) -> dict[str, MessageTimes]:
    """Read a bag once, and return the times of the messages of some topics whose types begin with a header.

    Args:
        bag: Bag to read.
        topics: Names of the topics.
        visitors: Function by topic that is called with each of its messages, which may be of any type.

    Raises:
        DriveError: The bag is damaged, or a message ends within its header.
    """
    stamps = {topic: array("q") for topic in topics}
    received = {topic: array("q") for topic in topics}
    size = sum(file.stat().st_size for file in bag.files)
    if size > _LONG_BAG_BYTES:
        log.warning("%s: reading %.0f GB once for the times of its messages", bag.path, size / 1e9)
    for message in bag.messages({*topics, *visitors}):
        if message.topic in visitors:
            visitors[message.topic](message)
        if message.topic in stamps:
            stamps[message.topic].append(header_stamp_ns(message, is_ros1=bag.is_ros1))
            received[message.topic].append(message.received_ns)
    return {topic: _ordered(stamps[topic], received[topic]) for topic in topics}


def header_stamp_ns(message: RawMessage, *, is_ros1: bool) -> int:
    """Return the stamp of the header that a message begins with, without decoding the message.

    Raises:
        DriveError: The message ends before.
    """
    data = message.data
    if len(data) < _HEADER_BYTES:
        raise DriveError(
            f"{message.topic} at {message.received_ns / 1e9:.3f} s",
            expected="a message that begins with a header",
            found=f"{len(data)} bytes",
        )
    # ROS 1: sequence number, s, ns. ROS 2: four bytes of which the second says little-endian, s, ns.
    order = "<" if is_ros1 or data[1] & 1 else ">"
    seconds, nanoseconds = struct.unpack_from(f"{order}iI", data, 4)
    return int(seconds) * 1_000_000_000 + int(nanoseconds)


def _ordered(stamps: "array[int]", received: "array[int]") -> MessageTimes:
    """Sort by stamp; where no message has a stamp, by recording."""
    stamps_ns, received_ns = np.array(stamps, np.int64), np.array(received, np.int64)
    if not stamps_ns.any():
        stamps_ns = received_ns
    is_first = np.append(True, received_ns[1:] != received_ns[:-1])[: len(received_ns)]
    places = np.arange(len(received_ns))
    ordinals = places - np.maximum.accumulate(np.where(is_first, places, 0))
    order = np.argsort(stamps_ns, kind="stable")
    return MessageTimes(stamps_ns[order], received_ns[order], ordinals[order].astype(np.int32))
