"""Run tasks on a cluster: each drive once, again where its worker died, and a row where it failed."""

import json
import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast, get_args

from data.batch.cluster import ClusterConfig, dashboard, open_cluster
from data.batch.drive_task import DriveOutcome, State, Task, sentence_of
from data.report.page import can_write_report
from data.report.report_file import write_report
from data.results.folder import DRIVES
from perception.atomic_file import atomic_file, write_atomically
from perception.errors import DriveError, PerceptionError

if TYPE_CHECKING:
    from distributed import Client, Future

_RETRIES = 2  # after an error that is none of ours, such as a file server that does not answer
# Documents of results whose numbers become columns.
_DOCUMENTS = ("summary.json", "metrics.json")
_WRITE_EVERY_S = 5.0
_MAX_LISTED = 10  # failures that are printed

RunCommand = Callable[[Sequence[str]], None]


def run_batch_tasks(
    tasks: Sequence[Task],
    out: Path,
    cluster: ClusterConfig,
    run: RunCommand,
    progress: Callable[..., Iterable[Any]],
) -> None:
    """Run all tasks on a cluster; print where it is, what became of them, and the report.

    Args:
        tasks: Drives with their commands.
        out: Folder of the results of all drives.
        cluster: Workers.
        run: Function of a module that runs a command line; workers import it.
        progress: Progress bar over the drives, with a description, their number and their unit.

    Raises:
        DriveError: A drive failed.
    """
    start_s = time.perf_counter()
    outcomes, rows = [], OutcomeRows(out, tasks)
    with open_cluster(cluster) as client:
        print(f"workers: {len(client.nthreads())}; dashboard: {dashboard(client)}", flush=True)
        ended = run_tasks(client, partial(run_task, run), tasks)
        try:
            for outcome in progress(ended, "batch", len(tasks), unit="drive"):
                outcomes.append(outcome)
                rows.add(outcome)
        finally:
            rows.write()
    if can_write_report():
        print(f"report: {write_report(out)}")
    print(_summary(outcomes, time.perf_counter() - start_s, out))
    if failed := [one for one in outcomes if one.state == "failed"]:
        raise DriveError(
            out / DRIVES,
            expected=f"{len(outcomes)} drives without an error",
            found=f"{len(failed)} with one, first {failed[0].name}",
            advice="mend them and repeat the command; the others are kept",
        )


def run_task(run: RunCommand, task: Task) -> DriveOutcome:
    """Run the command of a drive in this process, unless its results are there; called by workers."""
    start_s, key, frames, error = time.perf_counter(), "", 0, ""
    try:
        key, frames = task.key()
        if (earlier := task.finished(key)) is not None:
            return replace(earlier, state="skipped")
        task.folder.mkdir(parents=True, exist_ok=True)
        with (
            task.ready(frames) as (words, frames),
            (task.folder / "log.txt").open("w") as log,
            redirect_stdout(log),
            redirect_stderr(log),
        ):
            run(words)
    except PerceptionError as failure:
        error = sentence_of(failure)
    seconds, state = round(time.perf_counter() - start_s, 3), "failed" if error else "done"
    outcome = DriveOutcome(task.name, cast(State, state), frames, seconds, key, error)
    if not error:
        task.finish(outcome)
    return outcome


def _summary(outcomes: Sequence[DriveOutcome], seconds: float, out: Path) -> str:
    count = Counter(one.state for one in outcomes)
    frames = sum(one.frames for one in outcomes if one.state == "done")
    counted = ", ".join(f"{count[state]} {state}" for state in get_args(State))
    lines = [f"drives: {counted}; {frames} frames in {seconds:.1f} s; rows: {out / DRIVES}"]
    failed = [one for one in outcomes if one.state == "failed"]
    lines += [f"  {one.name}: {one.error}" for one in failed[:_MAX_LISTED]]
    if len(failed) > _MAX_LISTED:
        lines.append(f"  and {len(failed) - _MAX_LISTED} more")
    return "\n".join(lines)


def run_tasks(
    client: "Client", work: Callable[[Task], DriveOutcome], tasks: Sequence[Task]
) -> Iterator[DriveOutcome]:
    """Yield what became of each drive, in the order in which they end.

    Args:
        client: Cluster.
        work: Function of a module, which workers import; what it raises is tried again.
        tasks: Drives with their commands.

    Raises:
        PerceptionError: The scheduler was lost before all drives had ended.
    """
    from distributed import as_completed

    address = client.scheduler.address
    task_of = {client.submit(work, task, pure=False, retries=_RETRIES): task for task in tasks}
    for ended, future in enumerate(as_completed(task_of)):
        try:
            outcome = _outcome(task_of[future], future)
        except (OSError, CancelledError) as error:  # of the connection: those of the work are rows
            raise PerceptionError(
                f"scheduler {address}",
                expected=f"to be there until {len(tasks)} drives have ended",
                found=f"lost after {ended}",
                advice="start it and its workers again and repeat the command; what is done is kept",
            ) from error
        yield outcome


def _outcome(task: Task, future: "Future[DriveOutcome]") -> DriveOutcome:
    error = future.exception()
    if error is None:
        outcome: DriveOutcome = future.result()  # cancelled by a client that has lost the scheduler
        return outcome
    return DriveOutcome(task.name, "failed", 0, 0.0, "", sentence_of(error))


class OutcomeRows:
    """What became of the drives, with the numbers of their results: a row each in a folder's files."""

    def __init__(self, out: Path, tasks: Sequence[Task]) -> None:
        """Begin without rows; nothing is written yet."""
        self._out = out
        self._folder_of = {task.name: task.folder for task in tasks}
        self._rows: dict[str, dict[str, Any]] = {}
        self._written_s = -math.inf

    def add(self, outcome: DriveOutcome) -> None:
        """Take an outcome; write the rows where they have not been for a while."""
        own = vars(outcome)
        self._rows[outcome.name] = own | _numbers(self._folder_of[outcome.name]) | own
        # Writing all rows at each drive would cost more and more.
        if time.monotonic() > self._written_s + _WRITE_EVERY_S:
            self.write()

    def write(self) -> None:
        """Write drives.jsonl, and drives.parquet where pyarrow is installed."""
        self._written_s = time.monotonic()
        rows = [self._rows[name] for name in sorted(self._rows)]
        lines = "".join(f"{json.dumps(row)}\n" for row in rows)
        write_atomically(self._out / DRIVES, lines.encode())
        try:
            import pyarrow as pa
            from pyarrow import parquet
        except ImportError:
            return
        columns = list(dict.fromkeys(name for row in rows for name in row))
        table = pa.table({name: [row.get(name) for row in rows] for name in columns})
        with atomic_file(self._out / "drives.parquet") as part:
            parquet.write_table(table, part)


def _numbers(folder: Path) -> dict[str, float]:
    """Return the numbers of the documents in a folder of results by their names, those of sections with dots."""
    found: dict[str, float] = {}
    for document in _DOCUMENTS:
        path = folder / document
        if path.is_file():
            found |= dict(_leaves(json.loads(path.read_text())))
    return found


def _leaves(document: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, float]]:
    for name, value in document.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{name}.")
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            yield f"{prefix}{name}", float(value)
