"""The tasks of a batch: one for each drive or chunk of a drive, or for each part of synthetic drives."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from data.batch.drive_sources import DriveSource, chunks, find_drives, folder_names
from data.batch.drive_task import (
    DriveTask,
    RemoteDriveTask,
    SynthTask,
    Task,
    results_folder,
)
from data.open_drive import open_drive
from data.results.command_config import CommandConfig
from data.synthetic.collection import SynthConfig
from perception.errors import PerceptionError, UsageError
from perception.sensor import load_sensor

# Where each command writes, below the folder of a drive; check prints alone.
_OUTPUTS: Mapping[str, tuple[str, str]] = {
    "run": ("--out", ""),
    "label": ("--out", ""),
    "detect": ("--out", ""),
    "maps": ("--out", ""),
    "evaluate": ("--json", "metrics.json"),
}
# Frames of these do not depend on each other.
_IN_CHUNKS = ("maps", "detect")
_WORLDS_A_TASK = 4  # of the object layout: 20 frames


@dataclass(frozen=True)
class BatchedCommand:
    """A command that is run on many drives.

    Attributes:
        name: Words of the command, such as `evaluate ground`.
        words: Flags of the command.
        replaces_results: Whether it has the flag --overwrite.
        parse: Function from the words of a command line to its arguments and its configuration.
    """

    name: str
    words: tuple[str, ...]
    replaces_results: bool
    parse: Callable[[Sequence[str]], tuple[dict[str, Any], CommandConfig]]


def drive_tasks(
    command: BatchedCommand, sources: Sequence[str], chunk_frames: int | None, out: Path
) -> list[Task]:
    """Return a task for each drive, or for each chunk of a drive.

    Args:
        command: Command of each drive.
        sources: Drives, globs, URLs, or lists of them.
        chunk_frames: Number of frames of a chunk; None for whole drives.
        out: Folder of the results of all drives.

    Raises:
        UsageError: The frames of the command depend on each other, or a flag cannot be used.
        DriveError: A source holds no drive.
    """
    _require_chunks(command.name, chunk_frames)
    found, tasks = find_drives(sources), list[Task]()
    for source, drive_name in zip(found, folder_names(found), strict=True):
        chosen = [] if source.sequence is None else ["--sequence", source.sequence]
        read = [source.url or str(source.root), *chosen, *command.words]
        for chunk in (
            [None] if chunk_frames is None else _chunks(command, read, source, chunk_frames)
        ):
            name, part = drive_name, list[str]()
            if chunk is not None:
                name = f"{drive_name}-{chunk.start:06d}"
                part = ["--start", str(chunk.start), "--frames", str(len(chunk))]
            folder = results_folder(out, name)
            flag, file = _OUTPUTS.get(command.name.partition(" ")[0], ("", ""))
            line = [*read, *part, *([flag, str(folder / file)] if flag else [])]
            _, config = command.parse(line)
            again = ["--overwrite"] if command.replaces_results else []
            of_all = (name, (*command.name.split(), *line, *again), folder, config.text())
            if source.url:
                tasks.append(RemoteDriveTask(*of_all, source.url))
            else:
                tasks.append(DriveTask(*of_all, source.root, source.sequence, chunk))
    return tasks


def _require_chunks(name: str, size: int | None) -> None:
    if size is not None and size < 1:
        raise UsageError("--chunk-frames", expected="at least 1", found=str(size))
    if size is not None and name not in _IN_CHUNKS:
        raise UsageError(
            "--chunk-frames",
            expected=f"{' or '.join(_IN_CHUNKS)}, whose frames do not depend on each other",
            found=name,
        )


def _chunks(
    command: BatchedCommand, words: Sequence[str], source: DriveSource, size: int
) -> list[range] | list[None]:
    """Return the chunks of a drive; none of one at a URL, or that cannot be opened: its task will say why."""
    frames = command.parse(words)[0]["drive"]
    if source.url:
        return [None]
    try:
        whole = replace(frames.reading, start=0, every=1)
        drive = open_drive(source.root, sequence=source.sequence, config=whole)
    except PerceptionError:
        return [None]
    return chunks(len(drive), frames.start, frames.frames, size, frames.every) or [None]


def synth_tasks(command: BatchedCommand, out: Path) -> list[Task]:
    """Return a task for each synthetic drive, or for each 20 frames of the object layout.

    Args:
        command: The command synth.
        out: Folder for the drives.
    """
    line = [str(out), *command.words]
    given, config = command.parse(line)
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


def shared_folder(out: Path) -> Path:
    """Return the folder of all results as an absolute path: a worker may have another current folder.

    Raises:
        UsageError: It is at a URL, whose slashes a path has joined.
    """
    if out.parts and out.parts[0].endswith(":") and len(out.parts[0]) > len("C:"):
        raise UsageError(
            "--out",
            expected="a folder that all workers see",
            found=f"a URL of {out.parts[0]}",
            advice="write to a folder, and copy what is whole",
        )
    return out.absolute()
