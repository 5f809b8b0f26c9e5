"""The video of a run: one image a frame, drawn beside the pipeline, and a preview of its middle."""

from dataclasses import replace

import av
import cv2
import numpy as np
import pytest

from data.results.result_writer import open_writers
from data.results.run_video import RunVideo
from data.results.run_writers import BackgroundWriter
from perception.render.composition import Composition
from perception.types import Boxes3D, Tracks
from tests.render.conftest import scene  # noqa: F401 - fixture

LAYOUT = Composition(size_px=(640, 360))


@pytest.fixture
def results(scene):  # noqa: F811 - fixture
    """Four frames of one object that drives on."""

    def at(step):
        box = Boxes3D(
            np.array([[9.0 + 2 * step, 0, -1.7]]), np.array([[4.0, 2.0, 1.5]]), np.zeros(1)
        )
        tracks = Tracks.unclassified(np.array([1]), box, np.array([[20.0, 0]]), np.ones(1, bool))
        frame = replace(scene.frame, index=step, stamp_s=0.1 * step)
        return replace(scene, frame=frame, tracks=tracks)

    return [at(step) for step in range(4)]


def images_of(path):
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def video_of(out, frames, *, is_sequence=True):
    video = RunVideo(out, LAYOUT, frames, is_sequence=is_sequence)
    return open_writers([BackgroundWriter(video, "video")])


def write(out, results, *, is_sequence=True):
    with video_of(out, len(results), is_sequence=is_sequence) as (video,):
        for result in results:
            video.add(result, None)


def test_a_run_leaves_a_video_and_the_preview_of_its_middle(results, tmp_path):
    write(tmp_path, results)
    images = images_of(tmp_path / "video.mp4")
    assert [image.shape for image in images] == [(360, 640, 3)] * 4
    preview = cv2.imread(str(tmp_path / "preview.jpg"))[:, :, ::-1].astype(int)
    errors = [np.abs(preview - image).mean() for image in images]
    assert int(np.argmin(errors)) == 2


def test_paths_and_speeds_need_a_sequence(results, tmp_path):
    for name, is_sequence in (("sequence", True), ("frames", False)):
        (tmp_path / name).mkdir()
        write(tmp_path / name, results, is_sequence=is_sequence)
    sequence, frames = (
        images_of(tmp_path / name / "video.mp4")[3].astype(int) for name in ("sequence", "frames")
    )
    # The object's path in the view from above.
    assert np.abs(sequence - frames)[:, 400:].max() > 60


def test_a_run_that_fails_leaves_a_partial_video(results, tmp_path):
    with pytest.raises(RuntimeError), video_of(tmp_path, 4) as (video,):
        video.add(results[0], None)
        raise RuntimeError
    assert [path.name for path in tmp_path.iterdir()] == ["video.partial.mp4"]
