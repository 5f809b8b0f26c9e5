"""Workers that run the stages, each with a clock: threads side by side, or the calling thread itself."""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, ParamSpec, TypeVar

from perception.geometry.threads import limit_blas_threads
from perception.types import StageSpan

Params = ParamSpec("Params")
Returned = TypeVar("Returned")


class StageClock:
    """Measures the time of one stage after another on one worker."""

    def __init__(self, worker: str = "", arrival_s: float | None = None) -> None:
        """Start without a stage.

        Args:
            worker: Name of the worker that runs the stages.
            arrival_s: Time at which the frame arrived, by `time.perf_counter`; else now.
        """
        self._worker = worker
        self._arrival_s = time.perf_counter() if arrival_s is None else arrival_s
        self.spans: tuple[StageSpan, ...] = ()

    @property
    def elapsed_s(self) -> float:
        """Time since the frame arrived in seconds."""
        return time.perf_counter() - self._arrival_s

    @property
    def seconds(self) -> dict[str, float]:
        """Duration of each stage in seconds, of one that ran for each of several cameras that of all runs."""
        seconds: dict[str, float] = {}
        for span in self.spans:
            seconds[span.stage] = seconds.get(span.stage, 0.0) + span.stop_s - span.start_s
        return seconds

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure the time of a stage."""
        start_s = self.elapsed_s
        yield
        self.spans += (StageSpan(name, self._worker, start_s, self.elapsed_s),)

    def run(
        self,
        name: str,
        stage: Callable[Params, Returned],
        /,
        *args: Params.args,
        **kwargs: Params.kwargs,
    ) -> Returned:
        """Run a stage and measure its time."""
        with self.stage(name):
            return stage(*args, **kwargs)

    def add(self, span: StageSpan, offset_s: float) -> None:
        """Take over a stage that was measured elsewhere, since a time of this clock."""
        times_s = (offset_s + span.start_s, offset_s + span.stop_s)
        self.spans += (StageSpan(span.stage, span.worker or self._worker, *times_s),)

    @contextmanager
    def nested(self) -> Iterator[list[StageSpan]]:
        """Take over stages that were measured elsewhere: append their spans, relative to now, to the list.

        Spans without a worker are those of this clock's worker.
        """
        offset_s = self.elapsed_s
        nested: list[StageSpan] = []
        yield nested
        for span in nested:
            self.add(span, offset_s)


class ThreadWorker:
    """A worker with a thread of its own. NumPy, OpenCV and the networks let other threads run meanwhile."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._executor = ThreadPoolExecutor(1, thread_name_prefix=name)

    def submit(
        self, task: Callable[Params, Returned], /, *args: Params.args, **kwargs: Params.kwargs
    ) -> "Future[Returned]":
        """Add a task to the queue."""
        return self._executor.submit(_with_limited_blas, task, *args, **kwargs)

    def close(self) -> None:
        """Drop the tasks in the queue, and end the thread after the running one."""
        self._executor.shutdown(cancel_futures=True)


class InlineWorker:
    """A worker that runs each task at once, in the thread that submits it."""

    def __init__(self, name: str) -> None:
        self.name = name

    def submit(
        self, task: Callable[Params, Returned], /, *args: Params.args, **kwargs: Params.kwargs
    ) -> "Future[Returned]":
        """Run the task; return a future that is done."""
        future: Future[Returned] = Future()
        try:
            future.set_result(_with_limited_blas(task, *args, **kwargs))
        except Exception as error:  # any error belongs to whoever asks for the result
            future.set_exception(error)
        return future

    def close(self) -> None:
        """Do nothing: there is no thread to end."""


# Runs one task after another, in the order in which they are submitted.
Worker = ThreadWorker | InlineWorker


def _with_limited_blas(task: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:  # noqa: ANN401 - any task
    with limit_blas_threads():
        return task(*args, **kwargs)
