"""`trifuse batch`: a command on many drives at once."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from data.batch.cluster import ClusterConfig
from perception.cli.parser import CommandFunction, FlagGroup, flag_types, parse

RunCommand = Callable[[Sequence[str]], None]


@dataclass(frozen=True)
class ClusterFlags(ClusterConfig, FlagGroup):
    """Cluster."""


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
        chunk_frames: Number of frames of a task, for maps and detect, whose frames do not depend on each other; by default whole
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
    own: CommandFunction,
    command: str,
    function: CommandFunction,
    words: Sequence[str],
    run: RunCommand,
) -> None:
    """Run a command on every drive that the words name.

    Args:
        own: `batch` or `batch_synth`, for the flags of the batch.
        command: Words of the command, such as `evaluate ground`.
        function: The command.
        words: Words behind them: drives, flags of the batch and of the command.
        run: Function of a module that runs a command line; workers import it.

    Raises:
        UsageError: A flag is unknown, or its value is not of its type.
        DriveError: A source holds no drive, or a drive failed.
    """
    from data.batch.batch_run import run_batch_tasks
    from data.batch.tasks import BatchedCommand, drive_tasks, shared_folder, synth_tasks
    from perception.cli.progress import progress_bar

    flags, of_command = parse_batch(own, command, function, words)
    out = shared_folder(flags["out"])
    can_replace, prog = "overwrite" in flag_types(function), f"trifuse {command}"
    batched = BatchedCommand(
        command, tuple(of_command), can_replace, lambda line: parse(prog, function, line)
    )
    if own is batch_synth:
        tasks = synth_tasks(batched, out)
    else:
        tasks = drive_tasks(batched, flags["sources"], flags["chunk_frames"], out)
    run_batch_tasks(tasks, out, flags["cluster"], run, progress_bar)


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
