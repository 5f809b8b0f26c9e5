"""Detected vehicles of a run as a results file of nuScenes' detection task."""

import json
from pathlib import Path

from data.nuscenes.result_entries import ResultEntries
from data.recorded_drive import RecordedDrive
from data.results.result_writer import ResultWriter
from perception.atomic_file import write_atomically
from perception.render.scene import SelectedObject
from perception.types import Result


class NuScenesWriter(ResultWriter):
    """Writes one JSON file at the end of a run, whole also where that stops early."""

    def __init__(self, path: Path, drive: RecordedDrive) -> None:
        """Write nothing yet.

        Args:
            path: Path of the file.
            drive: Drive of the run.
        """
        self._path, self._entries = path, ResultEntries(drive)

    def add(self, result: Result, selected: SelectedObject | None) -> None:
        """Add the vehicles of one frame."""
        self._entries.add(result)

    def snapshot(self) -> bytes:
        """Return what was added."""
        return self._entries.snapshot()

    def restore(self, snapshot: bytes) -> None:
        """Go on with what was added."""
        self._entries.restore(snapshot)

    def close(self, *, is_complete: bool) -> None:
        """Write the file with the frames that were added."""
        write_atomically(self._path, json.dumps(self._entries.document()).encode())
