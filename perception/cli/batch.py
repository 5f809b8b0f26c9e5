"""`trifuse batch`: a command on many drives at once."""

import time
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from perception.cli.flags import require_positive
from perception.cli.parser import CommandFunction, FlagGroup, flag_types, parse
from perception.errors import DriveError, PerceptionError, UsageError

if TYPE_CHECKING:
    from data.batch.drive_sources import DriveSource
    from data.batch.drive_task import DriveOutcome, Task

# Where each command writes, below the folder of a drive; check prints alone.
_OUTPUTS: Mapping[str, tuple[str, str]] = {
    "run": ("--out", ""),
    "detect": ("--out", ""),
    "maps": ("--out", ""),
    "evaluate": ("--json", "metrics.json"),
}
# Frames of these do not depend on each other.
_IN_CHUNKS = ("maps", "detect")
_MAX_LISTED = 10  # failures that are printed
_WORLDS_A_TASK = 4  # of the object layout: 20 frames


@dataclass(frozen=True)
class ClusterFlags(FlagGroup):
    """Cluster.

    Attributes:
        workers: Number of processes on this machine; else one a core.
        scheduler: Running Dask scheduler whose workers are used instead: its address, such as tcp://10.0.0.5:8786, or the
            .json file that it wrote.
        memory_limit: Memory of a process, such as 4GiB, above which it is started again; else an equal share.
    """

    workers: int | None = None
    scheduler: str | None = None
    memory_limit: str | None = None


def batch(
    sources: list[str], *, out: Path, cluster: ClusterFlags, chunk_frames: int | None = None
) -> None:
    """Give every drive to a worker; go on where an earlier batch stopped, and report drives that fail.

    Flags that are not listed here are those of the command. Results of a drive are in OUT/drives/NAME, its output in
    log.txt there; OUT/drives.jsonl and drives.parquet have a row a drive. A drive whose files, configuration and version
    are those of a finished one is skipped.

    Example: trifuse batch run kitti/raw/2011_09_26/*_sync --out results/fleet --no-video

    Args:
        sources: Drives, globs of drives, URLs of both such as s3://bucket/drives/*, or .txt lists of them; all sequences
            of each that is no URL.
        out: Folder of the results of all drives.
        cluster: Workers.
        chunk_frames: Number of frames of a task, for maps and detect, whose frames do not depend on each other; else whole
            drives.
    """  # Its flags alone: `run_batch` knows the command, which no flag names.


def batch_synth(out: Path, *, cluster: ClusterFlags) -> None:
    """Write synthetic drives on all cores or a cluster: the same files as `trifuse synth`; go on where a batch stopped.

    Flags that are not listed here are those of `trifuse synth`. A worker writes a drive at a time, or 20 frames of the
    object layout; OUT/drives.jsonl has a row of each.

    Example: trifuse batch synth results/streets --drives 200 --frames 20

    Args:
        out: Folder for the drives.
        cluster: Workers.
    """


def run_batch(
    own: CommandFunction, command: str, function: CommandFunction, words: Sequence[str]
) -> None:
    """Run a command on every drive that the words name.

    Args:
        own: `batch` or `batch_synth`, for the flags of the batch.
        command: Words of the command, such as `evaluate ground`.
        function: The command.
        words: Words behind them: drives, flags of the batch and of the command.

    Raises:
        UsageError: A flag is unknown, or its value is not of its type.
        DriveError: A source holds no drive, or a drive failed.
    """
    flags, of_command = parse_batch(own, command, function, words)
    _require_folder(flags["out"])
    out = flags["out"].absolute()  # a worker that was started elsewhere has another current folder
    if own is batch_synth:
        tasks = _synth_tasks(function, of_command, out)
    else:
        tasks = _drive_tasks(command, function, of_command, flags, out)
    _run_all(tasks, out, flags["cluster"])


def parse_batch(
    own: CommandFunction, command: str, function: CommandFunction, words: Sequence[str]
) -> tuple[dict[str, Any], list[str]]:
    """Return the arguments of the batch, and the words of the command, which are parsed as well.

    Raises:
        UsageError: A flag is unknown, or its value is not of its type.
    """
    of_batch, of_command = _split(words, own)
    flags, _ = parse(f"trifuse batch {command}", own, of_batch)
    first = flags["sources"][0] if "sources" in flags else str(flags["out"])
    parse(f"trifuse {command}", function, [first, *of_command])
    return flags, of_command


def _split(words: Sequence[str], own: CommandFunction) -> tuple[list[str], list[str]]:
    """Return the words of the batch, drives included, and those of the command."""
    names = {f"--{name.replace('_', '-')}" for name in flag_types(own)}
    of_batch: list[str] = []
    of_command: list[str] = []
    target = of_batch
    for word in words:
        if word.startswith("--"):
            target = of_batch if word.partition("=")[0] in names else of_command
        target.append(word)
    return of_batch, of_command


def _require_folder(out: Path) -> None:
    """Validate that the folder of all results is none at a URL, whose slashes a path has joined."""
    if out.parts and out.parts[0].endswith(":") and len(out.parts[0]) > len("C:"):
        raise UsageError(
            "--out",
            expected="a folder that all workers see",
            found=f"a URL of {out.parts[0]}",
            advice="write to a folder, and copy what is whole",
        )


def _drive_tasks(
    command: str,
    function: CommandFunction,
    words: Sequence[str],
    flags: Mapping[str, Any],
    out: Path,
) -> "list[Task]":
    from data.batch.drive_sources import find_drives, folder_names
    from data.batch.drive_task import DriveTask, RemoteDriveTask, results_folder

    size = flags["chunk_frames"]
    _require_chunks(command, size)
    sources = find_drives(flags["sources"])
    tasks: list[Task] = []
    for source, drive_name in zip(sources, folder_names(sources), strict=True):
        chosen = [] if source.sequence is None else ["--sequence", source.sequence]
        read = [source.url or str(source.root), *chosen, *words]
        for chunk in [None] if size is None else _chunks(command, function, read, source, size):
            name = drive_name if chunk is None else f"{drive_name}-{chunk.start:06d}"
            part = (
                [] if chunk is None else ["--start", str(chunk.start), "--frames", str(len(chunk))]
            )
            folder = results_folder(out, name)
            flag, file = _OUTPUTS.get(command.partition(" ")[0], ("", ""))
            line = [*read, *part, *([flag, str(folder / file)] if flag else [])]
            _, config = parse(f"trifuse {command}", function, line)
            again = ["--overwrite"] if "overwrite" in flag_types(function) else []
            of_all = (name, (*command.split(), *line, *again), folder, config.text())
            if source.url:
                tasks.append(RemoteDriveTask(*of_all, source.url))
            else:
                tasks.append(DriveTask(*of_all, source.root, source.sequence, chunk))
    return tasks


def _require_chunks(command: str, size: int | None) -> None:
    require_positive("--chunk-frames", size)
    if size is not None and command not in _IN_CHUNKS:
        raise UsageError(
            "--chunk-frames",
            expected=f"{' or '.join(_IN_CHUNKS)}, whose frames do not depend on each other",
            found=command,
        )


def _chunks(
    command: str, function: CommandFunction, words: Sequence[str], source: "DriveSource", size: int
) -> "list[range] | list[None]":
    """Return the chunks of a drive; none of one at a URL, or that cannot be opened: its task will say why."""
    from data.batch.drive_sources import chunks
    from data.open_drive import open_drive

    frames = parse(f"trifuse {command}", function, words)[0]["drive"]
    whole = replace(frames.reading, start=0)
    try:
        drive = (
            None if source.url else open_drive(source.root, sequence=source.sequence, config=whole)
        )
    except PerceptionError:
        drive = None
    return (
        [None] if drive is None else chunks(len(drive), frames.start, frames.frames, size) or [None]
    )


def _synth_tasks(function: CommandFunction, words: Sequence[str], out: Path) -> "list[Task]":
    from data.batch.drive_task import SynthTask, results_folder
    from data.synthetic.collection import SynthConfig
    from perception.sensor import load_sensor

    line = [str(out), *words]
    given, config = parse("trifuse synth", function, line)
    synth_config = SynthConfig(
        **{name: given[name] for name in ("layout", "frames", "drives", "cameras")},
        sensor=load_sensor(given["sensor"]),
        ego_m_s=given["speed"],
    )
    parts = synth_config.units
    if synth_config.layout == "object":
        parts = -(-parts // _WORLDS_A_TASK)
    return [
        SynthTask(
            f"part-{number:04d}",
            ("synth", *line, "--part", f"{number}/{parts}"),
            results_folder(out, f"part-{number:04d}"),
            config.text(),
            synth_config.part(number, parts).frames,
        )
        for number in range(1, parts + 1)
    ]


def _run_all(tasks: "Sequence[Task]", out: Path, cluster: ClusterFlags) -> None:
    from data.batch.batch_run import OutcomeRows, run_tasks
    from data.batch.cluster import dashboard, open_cluster
    from data.report.page import can_write_report
    from data.report.report_file import write_report
    from perception.cli.progress import progress_bar

    start_s = time.perf_counter()
    outcomes, rows = [], OutcomeRows(out, tasks)
    with open_cluster(cluster.workers, cluster.scheduler, cluster.memory_limit) as client:
        print(f"workers: {len(client.nthreads())}; dashboard: {dashboard(client)}", flush=True)
        ended = run_tasks(client, run_task, tasks)
        try:
            for outcome in progress_bar(ended, "batch", len(tasks), unit="drive"):
                outcomes.append(outcome)
                rows.add(outcome)
        finally:
            rows.write()
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


def run_task(task: "Task") -> "DriveOutcome":
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
            task.ready(frames) as (words, frames),
            (task.folder / "log.txt").open("w") as log,
            redirect_stdout(log),
            redirect_stderr(log),
        ):
            run_command_line(words)
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
