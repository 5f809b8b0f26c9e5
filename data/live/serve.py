"""From a live source through the pipeline to the viewers; of frames that come too fast, the latest counts."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

from data.live.source import LiveSource
from data.messages.channels import ResultChannels, new_context
from data.messages.topics import topics
from perception.errors import PerceptionError, UsageError
from perception.pipeline import Pipeline, PipelineConfig
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


@dataclass
class LiveCounts:
    """Frames so far.

    Attributes:
        published: Frames whose results were published.
        dropped: Frames that were left out, as a later one was there.
    """

    published: int = 0
    dropped: int = 0

    def text(self) -> str:
        """Return the counts as a sentence."""
        return (
            f"frames published: {self.published}, dropped as later ones were there: {self.dropped}"
        )


@dataclass(frozen=True)
class ServerAddress:
    """Where viewers connect, and what they are shown.

    Attributes:
        host: Address of the network interface.
        port: Port.
        min_score: Score from which detections and vehicles are shown.
    """

    host: str
    port: int
    min_score: float


class Publisher(Protocol):
    """What takes results as they come."""

    def publish(self, result: Result) -> None:
        """Take a result, and wait for nobody."""


def serve_live(
    live: LiveSource,
    config: PipelineConfig,
    address: ServerAddress,
    publishers: Sequence[Publisher] = (),
) -> None:
    """Run the pipeline on a live source and publish the results; print where viewers connect.

    Args:
        live: Source of the frames.
        config: Pipeline configuration.
        address: Where viewers connect.
        publishers: Others to which results go.

    Raises:
        UsageError: The port is not free.
        KeyboardInterrupt: It was stopped; the message has the counts of the frames.
    """
    counts = LiveCounts()
    with (
        ResultServer(
            live.name,
            address.host,
            address.port,
            min_score=address.min_score,
            cameras=live.cameras,
        ) as server,
        Pipeline(live.sensor, config) as pipeline,
    ):
        print(
            f"{live.name}: connect a viewer of Foxglove's protocol to {server.address}", flush=True
        )
        try:
            serve_results(live, pipeline, [server, *publishers], counts)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(counts.text()) from None
    print(counts.text())


def serve_results(
    source: LiveSource,
    pipeline: Pipeline,
    publishers: Sequence[Publisher],
    counts: LiveCounts,
    *,
    on_result: Callable[[Result], None] = lambda result: None,
) -> None:
    """Publish the results of a source until it ends.

    Args:
        source: Source; closed at the end.
        pipeline: Pipeline.
        publishers: Servers and the like.
        counts: Counts that are kept up to date.
        on_result: Called after each result.

    Raises:
        PerceptionError: A frame cannot be used.
    """
    done = 0
    for frames in source.laps():
        pipeline.reset()
        with (
            pipeline.stream(frames, "latest", is_sequence=source.is_sequence) as results,
            _closed_by_errors(source, counts),
        ):
            for result in results:
                for one in publishers:
                    one.publish(result)
                counts.published += 1
                counts.dropped = done + results.dropped + source.dropped
                on_result(result)
        done += results.dropped
    source.close()


@contextmanager
def _closed_by_errors(source: LiveSource, counts: LiveCounts) -> Iterator[None]:
    """End the source before the stream, which waits for it, where it does not go on after an error."""
    try:
        yield
    except BaseException as error:
        # What cannot be used from the first frame on is a mistake of the user.
        if isinstance(error, PerceptionError) and counts.published and source.recovers_from(error):
            return
        source.close()
        raise
