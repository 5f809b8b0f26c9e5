"""Checkpoints of a run: what `trifuse run --resume` goes on from after the process was killed.

A checkpoint is one file, written whole: the memory of the pipeline, of the writers and of the summary after a frame, and
how long the files were to which every frame appends. A run that goes on cuts these off, and writes the frames after
the checkpoint again; files of single frames are replaced by the same bytes.
"""

import logging
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from data.results.result_writer import ResultWriter
from perception.atomic_file import write_atomically, writing
from perception.errors import DriveError
from perception.evaluation.run_summary import RunSummary
from perception.snapshot import NotStorableError, read_snapshot, write_snapshot
from perception.tracking.single_object.handover import TrackHandover
from perception.types import PipelineSnapshot

log = logging.getLogger(__name__)

CHECKPOINT = "checkpoint.zip"
# Files to which every frame appends.
_GROWING = ("*.jsonl", "poses.txt", "tracks/*.txt", "vehicles/*.txt")


@dataclass(frozen=True)
class Checkpoint:
    """State of a run between two frames.

    Attributes:
        frames: Number of frames of the drive that are done, damaged ones included.
        pipeline: State of the pipeline.
        handover: Tracker of one object that takes over a track, or None.
        summary: Summary of the frames.
        writers: Memory of each writer, in their order.
        sizes: Size in bytes of each file that grows, by its path in the folder of the results.
    """

    frames: int
    pipeline: PipelineSnapshot
    handover: TrackHandover | None
    summary: RunSummary
    writers: Sequence[bytes]
    sizes: Mapping[str, int]

    @classmethod
    def read(cls, folder: Path) -> Self | None:
        """Return the checkpoint of a folder of results, or None where there is none.

        Raises:
            DriveError: It is damaged.
        """
        path = folder / CHECKPOINT
        if not path.is_file():
            return None
        with writing(path):
            checkpoint = read_snapshot(path.read_bytes(), path)
        if not isinstance(checkpoint, cls):
            raise DriveError(path, expected="a checkpoint of a run", found="something else")
        return checkpoint

    def write(self, folder: Path) -> None:
        """Put the checkpoint in the place of the one before.

        Raises:
            NotStorableError: Something in it has no place in a file.
            WriteError: The disk is full.
        """
        write_atomically(folder / CHECKPOINT, write_snapshot(self))

    def rewind(self, folder: Path) -> None:
        """Cut off the files that have grown since.

        Raises:
            DriveError: A file is shorter than it was, or gone.
        """
        for name, size in growing_sizes(folder).items():
            path = folder / name
            with writing(path):
                if name not in self.sizes:
                    path.unlink()
                elif size > self.sizes[name]:
                    os.truncate(path, self.sizes[name])
        found = growing_sizes(folder)
        for name, size in self.sizes.items():
            if found.get(name) != size:
                raise DriveError(
                    folder / name,
                    expected=f"the {size} bytes that were written before the run was stopped",
                    found="no such file" if name not in found else f"{found[name]} bytes",
                    advice="start again with --overwrite",
                )


class Checkpoints:
    """Writes the checkpoints of a run; one that cannot be resumed is told so once."""

    def __init__(self, folder: Path, handover: TrackHandover | None) -> None:
        """Write nothing yet.

        Args:
            folder: Folder of the results.
            handover: Tracker of one object that takes over a track, or None.
        """
        self._folder, self._handover = folder, handover
        self._is_possible = True

    def write(
        self,
        frames: int,
        pipeline: PipelineSnapshot,
        summary: RunSummary,
        writers: Sequence[ResultWriter],
    ) -> None:
        """Write a checkpoint, unless something of the run cannot be stored.

        Args:
            frames: Number of frames of the drive that are done.
            pipeline: State of the pipeline after them.
            summary: Summary of them.
            writers: Writers to which all of them were added.

        Raises:
            WriteError: The disk is full.
        """
        if not self._is_possible:
            return
        try:
            memories = [writer.snapshot() for writer in writers]
            sizes = growing_sizes(self._folder)
            Checkpoint(frames, pipeline, self._handover, summary, memories, sizes).write(
                self._folder
            )
        except NotStorableError as error:
            self._is_possible = False
            log.warning("this run cannot be resumed, but only repeated: no checkpoint of %s", error)

    def remove(self) -> None:
        """Remove the checkpoint: the run is complete."""
        with suppress(FileNotFoundError):
            (self._folder / CHECKPOINT).unlink()


def growing_sizes(folder: Path) -> dict[str, int]:
    """Return the size of each file to which frames append, by its path in the folder."""
    files = sorted(path for pattern in _GROWING for path in folder.glob(pattern))
    return {
        path.relative_to(folder).as_posix(): path.stat().st_size
        for path in files
        if not path.name.startswith(".")
    }
