"""Independent parts of one task, in this process or shared by processes of this machine."""

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from threadpoolctl import threadpool_limits

from data.batch.cluster import ClusterConfig, open_cluster
from perception.errors import PerceptionError, UsageError
from perception.geometry.threads import usable_cores
from perception.types import Progress

_CHUNK = 16  # frames that a process takes at a time
# Starting processes takes as long as some hundred frames do.
_MIN_FRAMES = 256

Frame = TypeVar("Frame")
Part = TypeVar("Part")
Done = TypeVar("Done")


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


def run_parts(
    work: Callable[[Part], Done], parts: Sequence[Part], workers: int
) -> Iterator[tuple[Part, Done]]:
    """Yield each part with what was made of it, in the order in which they are done.

    Every process keeps to one core. A process that is ended from outside is started again, and its part given to
    another.

    Args:
        work: Function of a module, which other processes can import, or a partial of one.
        parts: Arguments of each call.
        workers: Number of processes; 1 runs in this process.

    Raises:
        PerceptionError: The work raised it, or one part ended its process again and again.
    """
    if workers < 1:
        raise UsageError("--workers", expected="at least 1", found=str(workers))
    if workers == 1 or len(parts) < 2:
        with threadpool_limits(limits=1):
            yield from ((part, work(part)) for part in parts)
        return
    with open_cluster(ClusterConfig(min(workers, len(parts)))) as client:
        from distributed import KilledWorker, as_completed

        part_of = {client.submit(work, part, pure=False): part for part in parts}
        try:
            for future in as_completed(list(part_of)):
                yield part_of.pop(future), future.result()  # whose memory is given back
        except KilledWorker as error:
            raise PerceptionError(
                f"{workers} worker processes",
                expected="all to go on",
                found="one that was ended from outside again and again, most often for want of memory",
                advice="repeat the command with fewer --workers; what is done is kept",
            ) from error
