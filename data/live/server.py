"""Results for live viewers: a WebSocket server that speaks Foxglove's protocol."""

from collections.abc import Sequence
from types import TracebackType
from typing import Self

from data.messages.channels import ResultChannels, new_context
from data.messages.topics import topics
from perception.errors import UsageError
from perception.types import Result

_WAITING_FRAMES = (
    2  # whose messages wait for a slow viewer; the oldest are dropped, so that none lags
)


class ResultServer:
    """Publishes results to all viewers that are connected; a context manager, which disconnects them."""

    def __init__(
        self, name: str, host: str, port: int, *, min_score: float, cameras: Sequence[str] = ()
    ) -> None:
        """Open the port.

        Args:
            name: Name that viewers show.
            host: Address of the network interface; 127.0.0.1 for viewers on this computer alone.
            port: Port; 0 for any that is free.
            min_score: Score from which detections and vehicles are shown.
            cameras: Names of the further cameras.

        Raises:
            MissingDependencyError: foxglove-sdk or rosbags is not installed.
            UsageError: The port cannot be opened.
        """
        context = new_context("trifuse serve")
        self._channels = ResultChannels(context, min_score, cameras)
        from foxglove import start_server

        backlog = _WAITING_FRAMES * len(topics(min_score, cameras))
        try:
            self._server = start_server(
                name=name, host=host, port=port, context=context, message_backlog_size=backlog
            )
        except (RuntimeError, OverflowError) as error:
            raise UsageError(
                f"port {port} of {host}",
                expected="a port that is free",
                found=str(error),
                advice="choose another one with --port",
            ) from error
        self.address = f"ws://{host}:{self._server.port}"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._server.stop()

    def publish(self, result: Result) -> None:
        """Send a result to those who have subscribed; never wait for them."""
        self._channels.publish(result)
