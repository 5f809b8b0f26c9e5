"""Writers of a run's results: files, video, exports, each of them fed frame by frame."""

from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from types import TracebackType
from typing import Protocol

from perception.render.scene import SelectedObject
from perception.snapshot import NotStorableError
from perception.types import Result


class ResultWriter(Protocol):
    """Writes the results of a run in one form; made after the folder of the results."""

    def add(self, result: Result, selected: SelectedObject | None) -> None:
        """Write the next frame.

        Args:
            result: Result of the frame.
            selected: Object that is tracked beside the pipeline, or None.
        """
        ...

    def snapshot(self) -> bytes:
        """Return what a new writer needs to go on from here; all that was added is in files then.

        Raises:
            NotStorableError: Its files cannot be continued.
        """
        raise NotStorableError(type(self).__name__)

    def restore(self, snapshot: bytes) -> None:
        """Go on from the snapshot of a writer of the same files; called before the first frame.

        Args:
            snapshot: What `snapshot` returned.

        Raises:
            PerceptionError: The files do not hold what was written then.
        """
        raise NotStorableError(type(self).__name__)

    def close(self, *, is_complete: bool) -> None:
        """Finish; called once.

        Args:
            is_complete: Whether all frames were added; not after an error or an interrupt.
        """
        ...


@contextmanager
def open_writers(writers: Iterable[ResultWriter]) -> Iterator[list[ResultWriter]]:
    """Make writers one after another, and close all at the end, the first one last.

    Args:
        writers: Writers; those that were made before one of them fails are closed, too.
    """
    with ExitStack() as stack:
        opened = []
        for writer in writers:
            stack.push(partial(_close, writer))
            opened.append(writer)
        yield opened


def _close(
    writer: ResultWriter,
    kind: type[BaseException] | None,
    error: BaseException | None,
    traceback: TracebackType | None,
) -> None:
    writer.close(is_complete=kind is None)
