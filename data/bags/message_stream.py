"""Messages of one topic by their number in time."""

from collections.abc import Iterator
from itertools import islice
from typing import Any

from data.bags.bag import Bag, RawMessage
from data.bags.message_times import MessageTimes
from perception.errors import DriveError

_MAX_SKIPPED = 100  # messages that are read in less time than a search takes


class MessageStream:
    """Reads the messages of a topic one at a time; the next one after another needs no search."""

    def __init__(self, bag: Bag, topic: str, times: MessageTimes) -> None:
        """Set the topic.

        Args:
            bag: Bag of the topic.
            topic: Name of the topic.
            times: Times of its messages.
        """
        self.topic = topic
        self.move_to(bag, times)

    def move_to(self, bag: Bag, times: MessageTimes) -> None:
        """Read the messages of the topic from another bag from now on."""
        self.bag, self.times = bag, times
        self._messages: Iterator[RawMessage] = iter(())
        self._last: tuple[int, int] | None = None  # time and ordinal of the message read last

    def __len__(self) -> int:
        return len(self.times)

    def __reduce__(self) -> tuple[type["MessageStream"], tuple[Bag, str, MessageTimes]]:
        """Search again in another process."""
        return MessageStream, (self.bag, self.topic, self.times)

    def where(self, index: int) -> str:
        """Return the place of a message, for error messages."""
        return f"{self.bag.path} {self.topic} message {index}"

    def read(self, index: int) -> Any:  # noqa: ANN401 - see Bag.decode
        """Return the fields of a message.

        Raises:
            DriveError: The bag is damaged there.
        """
        with self.bag.lock:
            message = self._find(index)
        return self.bag.decode(message)

    def _find(self, index: int) -> RawMessage:
        received_ns, ordinal = int(self.times.received_ns[index]), int(self.times.ordinals[index])
        message = self._ahead(received_ns, ordinal)
        if message is None:
            self._messages = self.bag.messages((self.topic,), received_ns)
            for _ in range(ordinal):
                next(self._messages, None)
            message = next(self._messages, None)
        if message is None or message.received_ns != received_ns:
            self._last = None
            raise DriveError(
                self.where(index),
                expected=f"the message recorded at {received_ns / 1e9:.3f} s",
                found="none",
                advice="was the bag changed while it was read?",
            )
        self._last = received_ns, ordinal
        return message

    def _ahead(self, received_ns: int, ordinal: int) -> RawMessage | None:
        """Return a message that comes soon after the one read last, without a search; else None."""
        if self._last is None:
            return None
        last_ns, last_ordinal = self._last
        if received_ns == last_ns and ordinal == last_ordinal + 1:
            return next(self._messages, None)
        if received_ns <= last_ns or ordinal:
            return None
        for message in islice(self._messages, _MAX_SKIPPED):
            if message.received_ns >= received_ns:
                return message if message.received_ns == received_ns else None
        return None
