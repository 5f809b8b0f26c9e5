"""Video of a run, and a preview image from its middle."""

from dataclasses import replace
from pathlib import Path

from data.results.result_writer import ResultWriter
from perception.atomic_file import write_jpeg
from perception.render.composition import Composition
from perception.render.scene import SceneObjects, SelectedObject
from perception.render.trails import SceneHistory
from perception.render.video import VideoWriter
from perception.snapshot import Restorable
from perception.types import Result, UInt8


class RunVideo(Restorable, ResultWriter):
    """Writes `video.mp4` and `preview.jpg` of a run."""

    memories = ("_count", "_history", "_video_snapshot")

    def __init__(
        self, out: Path, composition: Composition, frames: int, *, is_sequence: bool
    ) -> None:
        """Begin the video.

        Args:
            out: Folder of the results.
            composition: Layout of an image of the video.
            frames: Number of frames of the run.
            is_sequence: Whether the frames follow each other; else no paths are drawn.
        """
        self._out, self._composition = out, composition
        self._middle, self._count = frames // 2, 0
        self._video = VideoWriter(out / "video.mp4", 1 / composition.period_s)
        self._video_snapshot = b""
        self._canvas: UInt8 | None = None
        self._history = SceneHistory() if is_sequence else SceneHistory(duration_s=0.0)

    def add(self, result: Result, selected: SelectedObject | None) -> None:
        """Draw and encode the next frame."""
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

    def snapshot(self) -> bytes:
        """Return the history of the scene, and the state of the video."""
        self._video_snapshot = self._video.snapshot()
        return super().snapshot()

    def restore(self, snapshot: bytes) -> None:
        """Go on with the images that are in the partial video."""
        super().restore(snapshot)
        self._video.restore(self._video_snapshot)

    def close(self, *, is_complete: bool) -> None:
        """Close the video; it stays a partial file where something went wrong."""
        self._video.close(is_complete=is_complete)
