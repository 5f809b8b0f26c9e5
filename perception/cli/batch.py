"""`trifuse batch`: a command on many drives at once."""

import time
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from perception.cli.parser import CommandFunction, FlagGroup, flag_types, parse
from perception.errors import DriveError, PerceptionError

if TYPE_CHECKING:
    from data.batch.drive_sources import DriveSource
    from data.batch.drive_task import DriveOutcome, DriveTask

# Where each command writes, below the folder of a drive; check prints alone.
_OUTPUTS: Mapping[str, tuple[str, str]] = {
    "run": ("--out", ""),
    "detect": ("--out", ""),
    "maps": ("--out", ""),
    "evaluate": ("--json", "metrics.json"),
}
_MAX_LISTED = 10  # failures that are printed


@dataclass(frozen=True)
class ClusterFlags(FlagGroup):
    """Cluster.

    Attributes:
        workers: Number of processes on this machine; else one a core.
        scheduler: Address of a running Dask scheduler, such as tcp://10.0.0.5:8786, whose workers are used instead.
        memory_limit: Memory of a process, such as 4GiB, above which it is started again; else an equal share.
    """

    workers: int | None = None
    scheduler: str | None = None
    memory_limit: str | None = None


def batch(sources: list[str], *, out: Path, cluster: ClusterFlags) -> None:
    """Give every drive to a worker; go on where an earlier batch stopped, and report drives that fail.

    Flags that are not listed here are those of the command. Results of a drive are in OUT/drives/NAME, its output in
    log.txt there; OUT/drives.jsonl and drives.parquet have a row a drive. A drive whose files, configuration and version
    are those of a finished one is skipped.

    Example: trifuse batch run kitti/raw/2011_09_26/*_sync --out results/fleet --no-video

    Args:
        sources: Drives, globs of drives, or .txt lists of them; all sequences of each.
        out: Folder of the results of all drives.
        cluster: Workers.
    """  # Its flags alone: `run_batch` knows the command, which no flag names.


def run_batch(command: str, function: CommandFunction, words: Sequence[str]) -> None:
    """Run a command on every drive that the words name.

    Args:
        command: Words of the command, such as `evaluate ground`.
        function: The command.
        words: Words behind them: drives, flags of the batch and of the command.

    Raises:
        UsageError: A flag is unknown, or its value is not of its type.
        DriveError: A source holds no drive, or a drive failed.
    """
    from data.batch.drive_sources import find_drives

    flags, of_command = parse_batch(command, function, words)
    tasks = _tasks(command, function, of_command, find_drives(flags["sources"]), flags["out"])
    _run_all(tasks, flags["out"], flags["cluster"])


def parse_batch(
    command: str, function: CommandFunction, words: Sequence[str]
) -> tuple[dict[str, Any], list[str]]:
    """Return the arguments of the batch, and the words of the command, which are parsed as well.

    Raises:
        UsageError: A flag is unknown, or its value is not of its type.
    """
    own, of_command = _split(words)
    flags, _ = parse(f"trifuse batch {command}", batch, own)
    parse(f"trifuse {command}", function, [flags["sources"][0], *of_command])
    return flags, of_command


def _split(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the words of the batch, drives included, and those of the command."""
    names = {f"--{name.replace('_', '-')}" for name in flag_types(batch)}
    own: list[str] = []
    of_command: list[str] = []
    target = own
    for word in words:
        if word.startswith("--"):
            target = own if word.partition("=")[0] in names else of_command
        target.append(word)
    return own, of_command


def _tasks(
    command: str,
    function: CommandFunction,
    words: Sequence[str],
    sources: "Sequence[DriveSource]",
    out: Path,
) -> "list[DriveTask]":
    from data.batch.drive_sources import folder_names
    from data.batch.drive_task import DriveTask, results_folder

    tasks = []
    for source, name in zip(sources, folder_names(sources), strict=True):
        folder = results_folder(out, name)
        chosen = [] if source.sequence is None else ["--sequence", source.sequence]
        flag, file = _OUTPUTS.get(command.partition(" ")[0], ("", ""))
        output = [flag, str(folder / file)] if flag else []
        line = [str(source.root), *chosen, *output, *words]
        _, config = parse(f"trifuse {command}", function, line)
        again = ["--overwrite"] if "overwrite" in flag_types(function) else []
        all_words = (*command.split(), *line, *again)
        tasks.append(
            DriveTask(name, source.root, source.sequence, all_words, folder, config.text())
        )
    return tasks


def _run_all(tasks: "Sequence[DriveTask]", out: Path, cluster: ClusterFlags) -> None:
    from data.batch.batch_run import run_tasks, write_outcomes
    from data.batch.cluster import dashboard, open_cluster
    from data.report.page import can_write_report
    from data.report.report_file import write_report
    from perception.cli.progress import progress_bar

    start_s = time.perf_counter()
    outcomes = []
    with open_cluster(cluster.workers, cluster.scheduler, cluster.memory_limit) as client:
        print(f"workers: {len(client.nthreads())}; dashboard: {dashboard(client)}", flush=True)
        ended = run_tasks(client, run_task, tasks)
        for outcome in progress_bar(ended, "batch", len(tasks), unit="drive"):
            outcomes.append(outcome)
            write_outcomes(out, outcomes, tasks)
    if can_write_report():
        print(f"report: {write_report(out)}")
    print(_summary(outcomes, time.perf_counter() - start_s, out))
    if failed := [one for one in outcomes if one.state == "failed"]:
        raise DriveError(
            out / "drives.jsonl",
            expected=f"{len(outcomes)} drives without an error",
            found=f"{len(failed)} with one, first {failed[0].name}",
            advice="mend them and repeat the command; the others are kept",
        )


def run_task(task: "DriveTask") -> "DriveOutcome":
    """Run the command of a drive in this process, unless its results are there; called by workers."""
    from data.batch.drive_task import DriveOutcome, sentence_of
    from perception.cli.main import run_command_line

    start_s = time.perf_counter()
    key, frames = "", 0
    try:
        key, frames = task.key()
        if (earlier := task.finished(key)) is not None:
            return replace(earlier, state="skipped")
        task.folder.mkdir(parents=True, exist_ok=True)
        with (
            (task.folder / "log.txt").open("w") as log,
            redirect_stdout(log),
            redirect_stderr(log),
        ):
            run_command_line(task.words)
    except PerceptionError as error:
        seconds = round(time.perf_counter() - start_s, 3)
        return DriveOutcome(task.name, "failed", frames, seconds, key, sentence_of(error))
    seconds = round(time.perf_counter() - start_s, 3)
    outcome = DriveOutcome(task.name, "done", frames, seconds, key)
    task.finish(outcome)
    return outcome


def _summary(outcomes: "Sequence[DriveOutcome]", seconds: float, out: Path) -> str:
    count = {
        state: sum(one.state == state for one in outcomes)
        for state in ("done", "skipped", "failed")
    }
    frames = sum(one.frames for one in outcomes if one.state == "done")
    counted = ", ".join(f"{number} {state}" for state, number in count.items())
    lines = [f"drives: {counted}; {frames} frames in {seconds:.1f} s; rows: {out / 'drives.jsonl'}"]
    failed = [one for one in outcomes if one.state == "failed"]
    lines += [f"  {one.name}: {one.error}" for one in failed[:_MAX_LISTED]]
    if len(failed) > _MAX_LISTED:
        lines.append(f"  and {len(failed) - _MAX_LISTED} more")
    return "\n".join(lines)
