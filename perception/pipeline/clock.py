"""When each stage worked on a frame."""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

from perception.types import StageSpan


class StageClock:
    """Takes the time of one stage after another, on one worker."""

    def __init__(self, worker: str = "", arrival_s: float | None = None) -> None:
        """Begin without a stage.

        Args:
            worker: who runs the stages.
            arrival_s: when the frame came, by `time.perf_counter`; else now.
        """
        self._worker = worker
        self._arrival_s = time.perf_counter() if arrival_s is None else arrival_s
        self.spans: tuple[StageSpan, ...] = ()

    @property
    def seconds(self) -> dict[str, float]:
        """What each stage took."""
        return {span.stage: span.stop_s - span.start_s for span in self.spans}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Take the time of what is done within."""
        start_s = time.perf_counter() - self._arrival_s
        yield
        stop_s = time.perf_counter() - self._arrival_s
        self.spans += (StageSpan(name, self._worker, start_s, stop_s),)

    @contextmanager
    def nested(self) -> Iterator[list[StageSpan]]:
        """Take in the stages that are put into the list within, by times since this began.

        Those without a worker were run by this clock's own.
        """
        offset_s = time.perf_counter() - self._arrival_s
        nested: list[StageSpan] = []
        yield nested
        self.spans += tuple(
            StageSpan(
                part.stage,
                part.worker or self._worker,
                offset_s + part.start_s,
                offset_s + part.stop_s,
            )
            for part in nested
        )


def relative_to_start(spans: Sequence[StageSpan]) -> tuple[StageSpan, ...]:
    """Return the same with times since the first of the stages began, without what the frame waited before."""
    offset_s = min((span.start_s for span in spans), default=0.0)
    return tuple(
        replace(span, start_s=span.start_s - offset_s, stop_s=span.stop_s - offset_s)
        for span in spans
    )
