"""Channels of one context of Foxglove's SDK: whatever sinks it has, files or live viewers, get the messages."""

from typing import TYPE_CHECKING

from data.messages.definitions import definition_of, encoded
from data.messages.geometry import stamp_ns
from data.messages.topics import topics
from perception.errors import MissingDependencyError
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
    try:
        from foxglove import Context
    except ImportError as error:
        raise MissingDependencyError(
            "foxglove-sdk", needed_for=needed_for, extra="live", reason=error
        ) from error
    return Context()


class ResultChannels:
    """Publishes results on the topics of `data.messages.topics`."""

    def __init__(self, context: "Context", min_score: float) -> None:
        """Open no channel yet; each is opened with the first message of its topic.

        Args:
            context: Context with the sinks.
            min_score: Score from which detections and vehicles are shown.
        """
        self._context, self._topics = context, topics(min_score)
        self._channels: dict[str, Channel] = {}
        self._last: Result | None = None

    def publish(self, result: Result) -> None:
        """Publish a result; messages that nobody takes are not made."""
        for topic in self._topics:
            channel = self._channels.get(topic.name)
            if channel is not None and not channel.has_sinks():
                continue
            message = topic.message_of(result, self._last)
            if message is not None:
                channel = channel or self._open(topic.name, topic.kind)
                channel.log(encoded(message), log_time=stamp_ns(result.frame.stamp_s))
        self._last = result

    def _open(self, name: str, kind: str) -> "Channel":
        from foxglove import Channel, Schema

        schema = Schema(name=kind, encoding="ros2msg", data=definition_of(kind).encode())
        self._channels[name] = channel = Channel(
            name, schema=schema, message_encoding="cdr", context=self._context
        )
        return channel
