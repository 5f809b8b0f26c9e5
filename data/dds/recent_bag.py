"""The messages of the last moments as a bag, so that frames of live topics are made as those of recorded ones."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from data.bags.bag import Bag, BagTopic, RawMessage
from data.messages.definitions import typestore


class RecentBag(Bag):
    """Messages in memory."""

    def __init__(
        self, source: str, kinds: Mapping[str, str], messages: Mapping[str, Sequence[RawMessage]]
    ) -> None:
        """Keep the messages.

        Args:
            source: Where they come from, for error messages.
            kinds: Type of the messages by topic.
            messages: Messages by topic, in the order in which they came.
        """
        super().__init__(Path(source) / "topics")
        self._messages_of = messages
        self._counted = tuple(
            BagTopic(name, kinds[name], len(rows)) for name, rows in sorted(messages.items())
        )

    @cached_property
    def topics(self) -> tuple[BagTopic, ...]:
        """Topics by name."""
        return self._counted

    @property
    def files(self) -> list[Path]:
        """No files."""
        return []

    def messages(
        self, topics: Collection[str], start_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """Yield the messages of some topics in the order in which they came, from a time on."""
        chosen = [one for name in topics for one in self._messages_of.get(name, ())]
        chosen.sort(key=lambda one: one.received_ns)
        return (one for one in chosen if start_ns is None or one.received_ns >= start_ns)

    def decode(self, message: RawMessage) -> Any:  # noqa: ANN401 - see Bag.decode
        """Return the fields of a message.

        Raises:
            DriveError: Its bytes are not those of its type.
        """
        kind = self.kinds[message.topic]
        with self.errors(f"{message.topic}", f"a message of type {kind}"):
            return typestore().deserialize_cdr(message.data, kind)
