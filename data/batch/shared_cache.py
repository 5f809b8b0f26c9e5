"""A cache that processes of this machine fill together, before one of them reads it."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from data.batch.parts import run_parts
from perception.geometry.threads import usable_cores
from perception.types import Progress

_CHUNK = 16  # frames that a process takes at a time
# Starting processes takes as long as some hundred frames do.
_MIN_FRAMES = 256

Frame = TypeVar("Frame")


def fill_together(
    fill: Callable[[Sequence[Frame]], object],
    missing: Sequence[Frame],
    workers: int | None,
    progress: Progress = iter,
) -> None:
    """Let processes fill a cache; few frames are left to the process that needs them.

    Args:
        fill: Function of a module, or a partial of one, that caches what is made of some frames.
        missing: Frames that are not cached.
        workers: Number of processes; else one a core, where there are frames enough.
        progress: Wrapper of the loop over frames that may show its progress.

    Raises:
        PerceptionError: A process was ended from outside again and again.
    """
    processes = usable_cores() if workers is None else workers
    if processes == 1 or len(missing) < (2 if workers else _MIN_FRAMES):
        return
    chunks = [missing[first : first + _CHUNK] for first in range(0, len(missing), _CHUNK)]
    shown = iter(progress(range(len(missing))))
    for chunk, _ in run_parts(fill, chunks, processes):
        for _ in chunk:
            next(shown)
    next(shown, None)  # ends the bar
