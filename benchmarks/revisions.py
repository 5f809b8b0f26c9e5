"""Two revisions of the source tree on the same frames in turns: processor time of each stage, and its ratio.

    frames   0..4    5..9          5..9    10..14        10..14 ...
    process  this    this - other  other - other - this  this   ...

Both run one stage after another with one thread each, and are measured in processor time. A frame of one is compared
with the same frame of the other, computed moments before or after, so that the ratio holds on a busy machine.
"""

import io
import json
import os
import shutil
import subprocess
import sys
import tarfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import numpy as np

from benchmarks.revision_worker import FRAME, SORTED
from perception.errors import PerceptionError, UsageError
from perception.evaluation.report import Metric, Metrics, Table

ROOT = Path(__file__).parents[1]
THIS_TREE = "this source tree"
IN_SORTS = "all of a frame / sort"
# Frames before the first that is compared: registration has its window of scans then, kernels are compiled.
WARM_UP = 8
# Frames that one process computes before it is the other's turn: few, so that both meet the same load.
_TURN = 4
_KERNELS = "perception/kernels"
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OMP_THREAD_LIMIT", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)

# Time in seconds by stage, of each frame.
StageSeconds = Sequence[Mapping[str, float]]


@dataclass(frozen=True)
class StageRatio(Metrics):
    """Processor time of one stage in both revisions.

    Attributes:
        other_ms: Median time in the other revision in milliseconds; None where it has no such stage.
        this_ms: Median time in this source tree in milliseconds; None where it has no such stage.
        ratio: Median over the frames of the time in this source tree, relative to that in the other revision.
        ratio_p25: First quartile of the same ratio.
        ratio_p75: Third quartile of the same ratio.
        ratio_of_means: Mean time in this source tree, relative to that in the other revision: unlike medians, it counts
            what only some frames do.
    """

    other_ms: Annotated[float | None, Metric("other [ms]", ".2f")]
    this_ms: Annotated[float | None, Metric("this [ms]", ".2f")]
    ratio: Annotated[float | None, Metric("this / other", ".2f")]
    ratio_p25: Annotated[float | None, Metric("p25", ".2f")]
    ratio_p75: Annotated[float | None, Metric("p75", ".2f")]
    ratio_of_means: Annotated[float | None, Metric("of means", ".2f")]


def compare_with_revision(
    revision: str, drive: Path, frames: int, source: Sequence[str | None] = ()
) -> Table[StageRatio]:
    """Return the processor time of each stage in this source tree and in another revision.

    Args:
        revision: Name of the other revision, as git knows it.
        drive: Drive, in any layout.
        frames: Number of compared frames, after those that warm up.
        source: Sequence of the drive, LiDAR model and cameras; None for what the drive states.

    Raises:
        UsageError: There is no such revision, or too few frames.
        PerceptionError: One of the processes has ended.
    """
    with ExitStack() as on_exit:
        tree = on_exit.enter_context(source_tree(revision))
        words = (str(drive.resolve()), *(word or "" for word in source))
        other = on_exit.enter_context(_RevisionProcess(revision, tree, words))
        this = on_exit.enter_context(_RevisionProcess(THIS_TREE, ROOT, words))
        times: tuple[list[Mapping[str, float]], ...] = ([], [])
        for number, (first, last) in enumerate(_turns(frames)):
            sides = ((other, times[0]), (this, times[1]))
            for process, measured in sides if number % 2 else reversed(sides):
                measured.extend(process.run(first, last))
    compared = [of_one[WARM_UP:] for of_one in times]
    if not compared[0]:
        raise UsageError(
            str(drive),
            expected=f"more than the {WARM_UP} frames that warm up",
            found=str(len(times[0])),
        )
    count = f"{len(compared[0])} frames of {drive.name}"
    return stage_ratios(f"processor time of {THIS_TREE} and of {revision}, {count}", *compared)


def stage_ratios(title: str, other: StageSeconds, this: StageSeconds) -> Table[StageRatio]:
    """Return the table of all stages of either revision.

    Args:
        title: Title of the table.
        other: Times of the other revision.
        this: Times of this source tree, of the same frames.
    """
    stages = dict.fromkeys(stage for frame in (*this, *other) for stage in frame)
    ordered = [*(stage for stage in stages if stage not in (FRAME, SORTED)), FRAME, SORTED]
    rows = {stage: _ratio(_seconds(other, stage), _seconds(this, stage)) for stage in ordered}
    in_sorts = [_seconds(side, FRAME) / _seconds(side, SORTED) / 1e3 for side in (other, this)]
    rows[IN_SORTS] = _ratio(*in_sorts)
    note = f"{IN_SORTS}: a number of sorts, not milliseconds"
    return Table(title, StageRatio.columns(), rows, heading="stage", notes=(note,))


@contextmanager
def source_tree(revision: str) -> Iterator[Path]:
    """Write the source tree of a revision to a temporary folder.

    Args:
        revision: Name of the revision, as git knows it.

    Raises:
        UsageError: There is no such revision, or this is no clone of the repository.
    """
    command = ["git", "-C", str(ROOT), "archive", "--format=tar", revision]
    try:
        archive = subprocess.run(command, capture_output=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError) as error:
        said = getattr(error, "stderr", b"").decode().strip() or str(error)
        raise UsageError(
            f"--compare {revision}",
            expected="a revision that git knows",
            found=said.splitlines()[0],
        ) from error
    with TemporaryDirectory(prefix="trifuse-") as folder:
        with tarfile.open(fileobj=io.BytesIO(archive)) as tar:
            tar.extractall(folder, filter="data")
        _copy_compiled(ROOT / _KERNELS, Path(folder, _KERNELS))
        yield Path(folder)


def _copy_compiled(kernels: Path, others: Path) -> None:
    """Copy what numba has compiled of the files that both revisions share, so that these do not compile again.

    numba knows a file by its time and size. A compiled function's name tells the contents of the other files that it is
    compiled of, and compiled.py how all are compiled.
    """
    sources = (kernels / "compiled.py", *kernels.glob("*.py"))
    for source in sources:
        twin = others / source.name
        if twin.is_file() and twin.read_bytes() == source.read_bytes():
            shutil.copystat(source, twin)
            for file in kernels.glob(f"__pycache__/{source.stem}.*.nb[ci]"):
                (others / "__pycache__").mkdir(exist_ok=True)
                shutil.copy2(file, others / "__pycache__")
        elif source == sources[0]:
            return


class _RevisionProcess:
    """The process that runs the pipeline of one source tree; a context manager, which ends it."""

    def __init__(self, name: str, tree: Path, words: Sequence[str]) -> None:
        """Start the process.

        Args:
            name: Name of the revision.
            tree: Source tree.
            words: Path, sequence, sensor and cameras of the drive.
        """
        self._name = name
        worker = Path(__file__).with_name("revision_worker.py")
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(worker), *words],
            env={**os.environ, **_ONE_THREAD, "PYTHONPATH": str(tree)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __enter__(self) -> "_RevisionProcess":
        return self

    def __exit__(self, *error: object) -> None:
        self._process.communicate()

    def run(self, first: int, last: int) -> list[Mapping[str, float]]:
        """Return the times of a range of frames.

        Raises:
            PerceptionError: The process has ended.
        """
        assert self._process.stdin is not None and self._process.stdout is not None
        try:
            print(first, last, file=self._process.stdin, flush=True)
            times: list[Mapping[str, float]] = json.loads(self._process.stdout.readline())
        except (BrokenPipeError, json.JSONDecodeError) as error:
            raise PerceptionError(
                f"pipeline of {self._name}",
                expected="a process that runs until the last frame",
                found=f"a process that has ended with exit code {self._process.wait()}",
                advice="look for its message above",
            ) from error
        return times


def _turns(frames: int) -> Iterator[tuple[int, int]]:
    """Yield first and last frame of each turn, the first of which warms up."""
    yield 0, WARM_UP
    for first in range(WARM_UP, WARM_UP + frames, _TURN):
        yield first, min(first + _TURN, WARM_UP + frames)


def _seconds(frames: StageSeconds, stage: str) -> "np.ndarray[Any, np.dtype[np.float64]]":
    return np.array([frame.get(stage, np.nan) for frame in frames])


def _ratio(other_s: Any, this_s: Any) -> StageRatio:  # noqa: ANN401 - arrays, as above
    """Return the comparison of one stage, frame by frame."""
    middle, low, high = (_percentile(this_s / other_s, q) for q in (50, 25, 75))
    of_means = float(np.mean(this_s) / np.mean(other_s))
    return StageRatio(
        other_ms=_percentile(1e3 * other_s, 50),
        this_ms=_percentile(1e3 * this_s, 50),
        ratio=middle,
        ratio_p25=low,
        ratio_p75=high,
        ratio_of_means=of_means if np.isfinite(of_means) else None,
    )


def _percentile(values: Any, percent: float) -> float | None:  # noqa: ANN401 - an array, as above
    known = values[np.isfinite(values)]
    return float(np.percentile(known, percent)) if known.size else None
