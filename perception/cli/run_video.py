"""The pictures of a run, drawn and encoded beside the stages: a video, and one picture out of its middle."""

from collections import deque
from concurrent.futures import Future
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

from data.atomic_file import write_jpeg
from perception.cli.track_handover import ObjectTracking
from perception.pipeline.workers import ThreadWorker
from perception.render.composition import Composition
from perception.render.tracked_object_figure import TrackedObjectFigure
from perception.render.trails import Trails
from perception.render.video import VideoFile
from perception.types import Drive, Result

# So many frames wait to be drawn, at most.
_MAX_QUEUED = 2


class RunVideo(AbstractContextManager["RunVideo"], Protocol):
    """What a run asks of whoever draws."""

    def add(self, result: Result, object_tracking: ObjectTracking) -> None:
        """Take the next frame, and the object that is followed by itself."""
        ...


class NoRunVideo:
    """Draws nothing, where nothing is to be drawn."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None: ...

    def add(self, result: Result, object_tracking: ObjectTracking) -> None:
        """Drop the frame."""


@dataclass(frozen=True)
class _DrawnFrame:
    """What is drawn of one frame: all of it, less what is drawn as followed, and that."""

    result: Result
    without_object: Result
    tracked: TrackedObjectFigure | None


class RunVideoWriter:
    """Writes video.mp4 and preview.jpg of a run; a context manager."""

    def __init__(self, out: Path, drive: Drive, composition: Composition, frames: int) -> None:
        """Begin without a picture.

        Args:
            out: folder of the results.
            drive: that is run.
            composition: how its frames become pictures.
            frames: how many there will be.
        """
        self._out, self._composition = out, composition
        self._middle, self._count = frames // 2, 0
        self._video = VideoFile(out / "video.mp4", drive.sensor.rate_hz)
        self._trails = Trails()
        self._worker = ThreadWorker("pictures")
        self._queue: deque[Future[None]] = deque()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Draw what is in line, and close the video; give it its name where nothing went wrong."""
        is_complete = False
        try:
            while self._queue:
                self._queue.popleft().result()
            is_complete = error is None
        finally:
            self._worker.close()
            self._video.close(is_complete=is_complete)

    def add(self, result: Result, object_tracking: ObjectTracking) -> None:
        """Let a frame be drawn; wait where too many are in line."""
        while len(self._queue) >= _MAX_QUEUED:
            self._queue.popleft().result()
        drawn_frame = _DrawnFrame(
            result, object_tracking.without_object(result), object_tracking.figure
        )
        self._queue.append(self._worker.submit(self._draw, drawn_frame))

    def _draw(self, drawn_frame: _DrawnFrame) -> None:
        self._trails.add(drawn_frame.result)
        image = self._composition.draw(
            drawn_frame.without_object, self._trails, drawn_frame.tracked
        )
        self._video.add(image)
        if self._count == self._middle:
            write_jpeg(self._out / "preview.jpg", image, quality=88)
        self._count += 1
