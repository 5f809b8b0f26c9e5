"""Who does the stages' work: threads beside each other, or the caller himself."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, ParamSpec, Protocol, TypeVar

from perception.geometry.threads import limit_blas_threads

Params = ParamSpec("Params")
Returned = TypeVar("Returned")


class Worker(Protocol):
    """Does one task after another, in the order in which they are given."""

    @property
    def name(self) -> str:
        """What it is called."""
        ...

    def submit(
        self, task: Callable[Params, Returned], /, *args: Params.args, **kwargs: Params.kwargs
    ) -> "Future[Returned]":
        """Take a task; its result or error comes with the future."""
        ...

    def close(self) -> None:
        """Take no more; return when all that was begun is done."""
        ...


class ThreadWorker:
    """One thread, which waits where there is nothing to do; NumPy, OpenCV and the networks let others run."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._executor = ThreadPoolExecutor(1, thread_name_prefix=name)

    def submit(
        self, task: Callable[Params, Returned], /, *args: Params.args, **kwargs: Params.kwargs
    ) -> "Future[Returned]":
        """Take a task; tasks wait in line."""
        return self._executor.submit(_with_limited_blas, task, *args, **kwargs)

    def close(self) -> None:
        """Drop what waits, and end the thread after what it does now."""
        self._executor.shutdown(cancel_futures=True)


class InlineWorker:
    """Does each task at once, in the thread that gives it."""

    def __init__(self, name: str) -> None:
        self.name = name

    def submit(
        self, task: Callable[Params, Returned], /, *args: Params.args, **kwargs: Params.kwargs
    ) -> "Future[Returned]":
        """Do the task; return what came of it."""
        future: Future[Returned] = Future()
        try:
            future.set_result(_with_limited_blas(task, *args, **kwargs))
        except Exception as error:  # whatever it is, it is for the one who asks for the result
            future.set_exception(error)
        return future

    def close(self) -> None:
        """There is nothing to end."""


def _with_limited_blas(task: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:  # noqa: ANN401 - any task
    with limit_blas_threads():
        return task(*args, **kwargs)
