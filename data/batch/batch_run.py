"""Run tasks on a cluster: each drive once, again where its worker died, and a row where it failed."""

import json
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from pathlib import Path
from typing import TYPE_CHECKING, Any

from data.batch.drive_task import DriveOutcome, Task, sentence_of
from data.results.folder import DRIVES
from perception.atomic_file import atomic_file, write_atomically
from perception.errors import PerceptionError

if TYPE_CHECKING:
    from distributed import Client, Future

_RETRIES = 2  # after an error that is none of ours, such as a file server that does not answer
# Documents of results whose numbers become columns.
_DOCUMENTS = ("summary.json", "metrics.json")
_WRITE_EVERY_S = 5.0


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
