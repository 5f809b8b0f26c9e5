"""From a live source through the pipeline to the viewers; of frames that come too fast, the latest counts."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from data.live.server import ResultServer
from data.live.source import LiveSource
from perception.pipeline import Pipeline, PipelineConfig
from perception.types import Result


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
        cameras: Names of the further cameras.
    """

    host: str
    port: int
    min_score: float
    cameras: tuple[str, ...] = ()


def serve_live(live: LiveSource, config: PipelineConfig, address: ServerAddress) -> None:
    """Run the pipeline on a live source and publish the results; print where viewers connect.

    Args:
        live: Source of the frames.
        config: Pipeline configuration.
        address: Where viewers connect.

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
            cameras=address.cameras,
        ) as server,
        Pipeline(live.sensor, config) as pipeline,
    ):
        print(
            f"{live.name}: connect a viewer of Foxglove's protocol to {server.address}", flush=True
        )
        try:
            serve_results(live, pipeline, server, counts)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(counts.text()) from None
    print(counts.text())


def serve_results(
    source: LiveSource,
    pipeline: Pipeline,
    server: ResultServer,
    counts: LiveCounts,
    *,
    on_result: Callable[[Result], None] = lambda result: None,
) -> None:
    """Publish the results of a source until it ends.

    Args:
        source: Source; closed at the end.
        pipeline: Pipeline.
        server: Server.
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
            _closed_by_errors(source),
        ):
            for result in results:
                server.publish(result)
                counts.published += 1
                counts.dropped = done + results.dropped + source.dropped
                on_result(result)
            done += results.dropped
    source.close()


@contextmanager
def _closed_by_errors(source: LiveSource) -> Iterator[None]:
    """End the source before the stream, which waits for it."""
    try:
        yield
    except BaseException:
        source.close()
        raise
