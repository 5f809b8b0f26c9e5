"""Progress bars on stderr, and lines that do not run into them."""

import sys
from collections.abc import Iterable
from functools import partial
from typing import Any, TypeVar
from weakref import WeakSet

from tqdm import tqdm

from perception.types import Progress

Step = TypeVar("Step")
_TERMINAL_S, _LOG_S = 0.1, 10.0  # between two updates; a log keeps each of them

_OPEN: WeakSet["tqdm[Any]"] = WeakSet()


def progress_bar(
    steps: Iterable[Step],
    description: str,
    total: int | None = None,
    *,
    unit: str = "frame",
    delay_s: float = 0,
    done: int = 0,
) -> Iterable[Step]:
    """Iterate over steps and show how many are done.

    Args:
        steps: Steps, one after another.
        description: Text before the bar.
        total: Number of steps, where the iterable has no length.
        unit: Unit of a step.
        delay_s: Time before the bar is shown.
        done: Number of steps that were done before.
    """
    bar: Iterable[Step] = tqdm(
        steps,
        description,
        total,
        initial=done,
        unit=unit,
        file=sys.stderr,
        delay=delay_s,
        mininterval=_TERMINAL_S if sys.stderr.isatty() else _LOG_S,
    )
    _OPEN.add(bar)
    return bar


def counting_bar(description: str, total: int) -> "tqdm[Any]":
    """Return a bar that is a context manager and moves by `update(count)`."""
    return progress_bar((), description, total)


def frame_progress_bar(description: str, delay_s: float = 2) -> Progress:
    """Return a function that shows progress over frame numbers, after a delay."""
    return partial(progress_bar, description=description, delay_s=delay_s)


def compile_functions() -> None:
    """Compile or load the compiled functions of all modules that are imported, with a bar where it takes time."""
    from perception.kernels.compiled import load_compiled

    load_compiled(lambda all: progress_bar(all, "compiling", unit="function", delay_s=1))


def resample_bar(resamples: Iterable[int]) -> Iterable[int]:
    """Show the progress of a bootstrap, after a delay."""
    return progress_bar(resamples, "bootstrap", unit="resample", delay_s=2)


def search_bar(finished: Iterable[Step], done: int, parts: int) -> Iterable[Step]:
    """Show the progress of a search, of which some parts were done before."""
    return progress_bar(finished, "search", parts, unit="part", done=done)


def close_bars() -> None:
    """End the line of every bar that is open, so that the next line starts at the left."""
    for bar in list(_OPEN):
        bar.close()
        _OPEN.discard(bar)


def write_line(text: str) -> None:
    """Write a line to stderr above the bars that are open."""
    tqdm.write(text, file=sys.stderr)
