"""Video of a run, drawn and encoded in a thread beside the pipeline, and a preview image from its middle."""

from collections import deque
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Self

from perception.atomic_file import write_jpeg
from perception.pipeline.workers import ThreadWorker
from perception.render.composition import Composition
from perception.render.scene import SceneObjects, SelectedObject
from perception.render.trails import SceneHistory
from perception.render.video import VideoWriter
from perception.types import Drive, Result, UInt8

# Bounds the memory of frames that wait to be drawn.
_MAX_QUEUED = 2


class RunVideo:
    """Writes `video.mp4` and `preview.jpg` of a run, or nothing; a context manager."""

    def __init__(
        self,
        out: Path,
        composition: Composition | None,
        drive: Drive,
        frames: int,
    ) -> None:
        """Start the thread that draws.

        Args:
            out: Folder of the results.
            composition: Layout of an image of the video; None to write nothing.
            drive: Drive of the run.
            frames: Number of frames of the run.
        """
        self._out, self._composition = out, composition
        self._middle, self._count = frames // 2, 0
        rate_hz = drive.sensor.rate_hz
        self._video = None if composition is None else VideoWriter(out / "video.mp4", rate_hz)
        self._canvas: UInt8 | None = None
        self._history = SceneHistory() if drive.is_sequence else SceneHistory(duration_s=0.0)
        self._worker = ThreadWorker("video")
        self._queue: deque[Future[None]] = deque()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        """Draw the queue and close the video; it stays a partial file where something went wrong."""
        is_complete = False
        try:
            self._wait_for(0)
            is_complete = kind is None
        finally:
            self._worker.close()
            if self._video is not None:
                self._video.close(is_complete=is_complete)

    def add(self, result: Result, selected: SelectedObject | None) -> None:
        """Queue the next frame; wait while the queue is full.

        Args:
            result: Result of the frame.
            selected: Object that is tracked beside the pipeline, or None.
        """
        self._wait_for(_MAX_QUEUED - 1)
        self._queue.append(self._worker.submit(self._draw, result, selected))

    def _wait_for(self, length: int) -> None:
        while len(self._queue) > length:
            self._queue.popleft().result()

    def _draw(self, result: Result, selected: SelectedObject | None) -> None:
        if self._composition is None or self._video is None:
            return
        objects = SceneObjects.of(result, self._composition.display_score, selected)
        scene = self._history.update(result, objects)
        if selected is not None:
            scene = replace(scene, tracked=selected.tracked)
        # The same memory for every image: fresh pages of several megabytes cost 3 ms.
        self._canvas = image = self._composition.draw(scene, self._canvas)
        self._video.add(image)
        if self._count == self._middle:
            write_jpeg(self._out / "preview.jpg", image, quality=88)
        self._count += 1
