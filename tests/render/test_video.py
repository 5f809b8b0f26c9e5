from dataclasses import dataclass

import av
import numpy as np
import pytest

from perception.errors import ImageError
from perception.render.video import NullVideoWriter, VideoWriter, open_video

PICTURE = np.full((64, 96, 3), (200, 40, 40), np.uint8)


@dataclass(frozen=True)
class Played:
    frames: list[np.ndarray]
    rate_hz: float
    pixel_format: str


def read_back(path):
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
        return Played(frames, float(stream.average_rate), stream.codec_context.pix_fmt)


def test_every_image_is_read_back(tmp_path):
    path = tmp_path / "new folder" / "drive.mp4"
    with VideoWriter(path, rate_hz=10.0) as video:
        for _ in range(12):
            video.add(PICTURE)
    played = read_back(path)
    assert len(played.frames) == 12
    assert played.frames[0].shape == PICTURE.shape
    assert np.abs(played.frames[5].astype(int) - PICTURE).max() < 12
    assert played.rate_hz == 10
    assert played.pixel_format == "yuv420p"
    assert [file.name for file in path.parent.iterdir()] == ["drive.mp4"]


def test_a_failed_run_leaves_a_file_that_plays(tmp_path):
    path = tmp_path / "drive.mp4"
    with pytest.raises(RuntimeError, match="broke"), VideoWriter(path) as video:
        for _ in range(5):
            video.add(PICTURE)
        raise RuntimeError("the run broke")
    assert not path.exists()
    assert len(read_back(tmp_path / "drive.partial.mp4").frames) == 5


def test_a_failed_run_leaves_the_last_good_video_alone(tmp_path):
    path = tmp_path / "drive.mp4"
    path.write_bytes(b"of an earlier run")
    with pytest.raises(RuntimeError), VideoWriter(path) as video:
        video.add(PICTURE)
        raise RuntimeError
    assert path.read_bytes() == b"of an earlier run"


def test_another_size_is_refused_and_earlier_images_are_kept(tmp_path):
    with pytest.raises(ImageError) as error, VideoWriter(tmp_path / "drive.mp4") as video:
        video.add(PICTURE)
        video.add(PICTURE[:32])
    assert error.value.found == str(PICTURE[:32].shape)
    assert len(read_back(tmp_path / "drive.partial.mp4").frames) == 1


def test_odd_sizes_are_refused_before_a_file_is_made(tmp_path):
    with pytest.raises(ImageError) as error, VideoWriter(tmp_path / "drive.mp4") as video:
        video.add(PICTURE[:63])
    assert error.value.found == f"{PICTURE.shape[1]}x63 pixels"
    assert list(tmp_path.iterdir()) == []


def test_without_images_there_is_no_file(tmp_path):
    with VideoWriter(tmp_path / "drive.mp4"):
        pass
    assert list(tmp_path.iterdir()) == []


def test_no_video_accepts_images_too(tmp_path):
    with open_video(None) as nothing:
        assert isinstance(nothing, NullVideoWriter)
        nothing.add(PICTURE)
    assert isinstance(open_video(tmp_path / "drive.mp4"), VideoWriter)


def images(count):
    """Return images in which something moves."""
    random = np.random.default_rng(0)
    base = random.integers(0, 256, PICTURE.shape, np.uint8)
    return [np.roll(base, (index, 2 * index), (0, 1)) for index in range(count)]


def test_a_video_goes_on_where_a_killed_process_left_it(tmp_path):
    whole, killed = VideoWriter(tmp_path / "whole.mp4"), VideoWriter(tmp_path / "killed.mp4")
    snapshots = []
    for index, image in enumerate(images(9)):
        whole.add(image)
        if index < 7:
            killed.add(image)
        if index in (2, 4):
            whole.snapshot()
            snapshots.append(killed.snapshot())
    whole.close(is_complete=True)
    expected = read_back(tmp_path / "whole.mp4").frames
    for start, snapshot in ((5, snapshots[1]), (3, snapshots[0])):
        resumed = VideoWriter(tmp_path / "killed.mp4")
        resumed.restore(snapshot)  # of a file that nobody has closed, then of one that is whole
        for index, image in enumerate(images(9)[start:], start):
            resumed.add(image)
            if index == 4:
                resumed.snapshot()
        resumed.close(is_complete=True)
        found = read_back(tmp_path / "killed.mp4").frames
        assert len(found) == 9
        assert all(map(np.array_equal, found, expected))


def test_a_partial_video_that_is_too_short_is_named(tmp_path):
    video = VideoWriter(tmp_path / "drive.mp4")
    for image in images(5):
        video.add(image)
    snapshot = video.snapshot()
    video.close(is_complete=False)
    video.partial_path.write_bytes(video.partial_path.read_bytes()[:200])
    with pytest.raises(ImageError, match=r"drive\.partial\.mp4: expected the 5 images"):
        VideoWriter(tmp_path / "drive.mp4").restore(snapshot)
