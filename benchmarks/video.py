"""Images of a video: drawn beside the same content by plain OpenCV, and encoded beside OpenCV's writer."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.measure import Comparison, Contender, compare
from benchmarks.reference.video import OpenCvVideo, draw_by_opencv
from benchmarks.stages import PreparedDrive
from perception.pipeline import Pipeline, PipelineConfig
from perception.render.composition import Composition
from perception.render.scene import Scene, SceneObjects
from perception.render.trails import SceneHistory
from perception.render.video import VideoWriter
from perception.types import UInt8


def compare_video(prepared: PreparedDrive) -> Comparison:
    """Draw the results of the whole pipeline, and encode the drawn images.

    Raises:
        ImageError: An image cannot be encoded.
    """
    composition = Composition()
    scenes = _scenes(prepared, composition)
    images = [composition.draw(scene) for scene in scenes]
    rate_hz = prepared.drive.sensor.rate_hz
    with TemporaryDirectory(prefix="trifuse-") as folder:
        ours = VideoWriter(Path(folder, "ours.mp4"), rate_hz)
        peer = OpenCvVideo(Path(folder, "plain.mp4"), rate_hz, composition.size_px)
        contenders = [
            Contender("Trifuse: drawing", _OnOneCanvas(composition, scenes).run),
            Contender("plain OpenCV: drawing", lambda i: draw_by_opencv(scenes[i], composition)),
            Contender("Trifuse: encoding (H.264)", _adding(ours.add, images)),
            Contender("plain OpenCV: encoding (MPEG-4)", _adding(peer.add, images)),
        ]
        try:
            return compare("video, 1600x900", contenders, len(scenes))
        finally:
            ours.close(is_complete=True)
            peer.close()


def _scenes(prepared: PreparedDrive, composition: Composition) -> list[Scene]:
    history, scenes = SceneHistory(), []
    with Pipeline(prepared.drive.sensor, PipelineConfig()) as pipeline:
        for frame in prepared.frames:
            result = pipeline.step(frame)
            objects = SceneObjects.of(result, composition.display_score, None)
            scenes.append(history.update(result, objects))
    return scenes


@dataclass
class _OnOneCanvas:
    """Draws as a run does: every image onto the same canvas."""

    composition: Composition
    scenes: list[Scene]
    canvas: UInt8 | None = field(default=None)

    def run(self, i: int) -> UInt8:
        self.canvas = self.composition.draw(self.scenes[i], self.canvas)
        return self.canvas


def _adding(add: Callable[[UInt8], None], images: list[UInt8]) -> Callable[[int], None]:
    return lambda i: add(np.ascontiguousarray(images[i]))
