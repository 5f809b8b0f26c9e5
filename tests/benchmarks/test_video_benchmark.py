"""The video beside plain OpenCV: the same content, and all four contenders in the table."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from benchmarks import video
from benchmarks.reference.video import OpenCvVideo, draw_by_opencv
from benchmarks.stages import PreparedDrive
from data.synthetic.drive import SyntheticDrive
from perception.pipeline import Pipeline, PipelineConfig
from perception.render import palette
from perception.render.composition import Composition
from perception.render.scene import SceneObjects
from perception.render.trails import SceneHistory
from perception.sensor import VLP_16


@pytest.fixture(scope="module")
def scene():
    drive = SyntheticDrive(2, sensor=VLP_16, images=False)
    with Pipeline(drive.sensor, PipelineConfig.for_obstacles()) as pipeline:
        result = [pipeline.step(frame) for frame in drive][-1]
    return SceneHistory().update(result, SceneObjects.of(result, 0.5, None))


def test_opencv_drawing_shows_ground_and_obstacles(scene):
    image = draw_by_opencv(scene, Composition())
    assert image.shape == (900, 1600, 3)
    is_static = (image == palette.STATIC).all(axis=2)
    assert is_static.sum() > 500
    ground = np.array(palette.GROUND) * 0.4 + np.array(palette.BACKGROUND) * 0.6
    assert (np.abs(image.astype(float) - ground).max(axis=2) <= 1).sum() > 20_000


def test_drawing_and_encoding_are_measured_beside_opencv(monkeypatch, scene):
    monkeypatch.setattr(video, "_scenes", lambda *_: [scene])
    drive = SimpleNamespace(sensor=VLP_16)
    table = video.compare_video(PreparedDrive(drive, [], [], PipelineConfig())).text()
    for name in ("Trifuse: drawing", "plain OpenCV: drawing", "(H.264)", "(MPEG-4)"):
        assert name in table


def test_the_opencv_writer_writes_a_video_of_its_images(tmp_path):
    writer = OpenCvVideo(tmp_path / "plain.mp4", 10.0, (64, 48))
    writer.add(np.full((48, 64, 3), (200, 0, 0), np.uint8))
    writer.close()
    is_read, image = cv2.VideoCapture(str(tmp_path / "plain.mp4")).read()
    assert is_read
    assert np.abs(image[24, 32].astype(int) - (0, 0, 200)).max() < 12
