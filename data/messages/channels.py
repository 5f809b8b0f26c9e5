"""Channels of one context of Foxglove's SDK: whatever sinks it has, files or live viewers, get the messages."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from data.messages.definitions import definition_of, encoded
from data.messages.geometry import stamp_ns
from data.messages.topics import Topic, topics
from perception.errors import optional_package
from perception.types import Result

if TYPE_CHECKING:
    from foxglove import Channel, Context


def new_context(needed_for: str) -> "Context":
    """Return a context without sinks.

    Args:
        needed_for: What the user asked for, for the message where the package is missing.

    Raises:
        MissingDependencyError: foxglove-sdk is not installed.
    """
    with optional_package("foxglove-sdk", needed_for=needed_for, extra="live"):
        from foxglove import Context
    return Context()


class ResultChannels:
    """Publishes results on the topics of `data.messages.topics`."""

    def __init__(self, context: "Context", min_score: float, cameras: Sequence[str] = ()) -> None:
        """Open the channels of all topics, so that viewers know them before the first result.

        Args:
            context: Context, best without sinks yet: a viewer that is connected when a channel is opened may subscribe
                before the server is ready for it.
            min_score: Score from which detections and vehicles are shown.
            cameras: Names of the further cameras.
        """
        self._context = context  # its channels are closed when it is gone
        self._channels = [(topic, _open(context, topic)) for topic in topics(min_score, cameras)]
        self._last: Result | None = None

    def publish(self, result: Result) -> None:
        """Publish a result; messages that nobody takes are not made."""
        for topic, channel in self._channels:
            message = topic.message_of(result, self._last) if channel.has_sinks() else None
            if message is not None:
                channel.log(encoded(message), log_time=stamp_ns(result.frame.stamp_s))
        self._last = result


def _open(context: "Context", topic: Topic) -> "Channel":
    from foxglove import Channel, Schema

    definition = definition_of(topic.kind).encode()
    schema = Schema(name=topic.kind, encoding="ros2msg", data=definition)
    return Channel(topic.name, schema=schema, message_encoding="cdr", context=context)
