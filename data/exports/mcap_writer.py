"""Results as an MCAP file, which Foxglove and the tools of ROS 2 open."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

from data.messages.channels import ResultChannels, new_context
from data.results.result_writer import ResultWriter
from perception.atomic_file import part_of, write_error, writing
from perception.render.scene import SelectedObject
from perception.types import Result


class McapWriter(ResultWriter):
    """Writes one file; a partial one until it is closed."""

    def __init__(
        self, path: Path, min_score: float, origin_ns: int = 0, cameras: Sequence[str] = ()
    ) -> None:
        """Open the partial file; make its folder.

        Args:
            path: Path of the whole file, `.mcap`.
            min_score: Score from which detections and vehicles are shown.
            origin_ns: Time in nanoseconds at which the stamps of the drive are 0.
            cameras: Names of the further cameras.

        Raises:
            MissingDependencyError: foxglove-sdk or rosbags is not installed.
            WriteError: The file cannot be written.
        """
        context = new_context("MCAP files")
        from foxglove import open_mcap
        from foxglove.mcap import MCAPWriteOptions

        self._path, self._channels = path, ResultChannels(context, min_score, cameras)
        self._origin_s = origin_ns / 1e9
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = _CheckedFile(part_of(path).open("wb"))
        # The profile is what tools of ROS 2 look for. One thread compresses; the cores are the pipeline's.
        options = MCAPWriteOptions(profile="ros2", compression_level=1, compression_threads=0)
        self._writer = open_mcap(self._file, context=context, writer_options=options)

    def add(self, result: Result, selected: SelectedObject | None) -> None:
        """Write the messages of a result.

        Raises:
            WriteError: The disk is full.
        """
        del selected
        frame = result.frame
        dated = replace(frame, stamp_s=frame.stamp_s + self._origin_s)
        self._channels.publish(replace(result, frame=dated))
        self._check()

    def close(self, *, is_complete: bool) -> None:
        """Write the index, and put the file in its place; of a run that stopped, with the frames that are done.

        Raises:
            WriteError: The disk is full; no file is left.
        """
        del is_complete
        try:
            self._writer.close()
        except (
            RuntimeError
        ):  # the SDK's own error about a write that failed, which the file has kept
            if self._file.error is None:
                raise
        finally:
            self._file.close()
        self._check()
        with writing(self._path):
            part_of(self._path).replace(self._path)

    def _check(self) -> None:
        if self._file.error is not None:
            part_of(self._path).unlink(missing_ok=True)
            raise write_error(self._path, self._file.error) from self._file.error


class _CheckedFile:
    """A file that keeps its first error, which the SDK would only print."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.error: OSError | None = None

    def write(self, data: bytes | bytearray) -> int:
        with self._keeping_errors():
            self._file.write(data)
        return len(data)

    def seek(self, offset: int, whence: int = 0) -> int:
        return self._file.seek(offset, whence)

    def flush(self) -> None:
        with self._keeping_errors():
            self._file.flush()

    def close(self) -> None:
        with self._keeping_errors():
            self._file.close()

    @contextmanager
    def _keeping_errors(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self.error = self.error or error
