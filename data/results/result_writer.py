"""Writers of a run's results: files, video, exports, each of them fed frame by frame."""

from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from types import TracebackType
from typing import Protocol

from perception.render.scene import SelectedObject
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
