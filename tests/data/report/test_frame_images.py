"""The player's images: panels of the video, as many as fit."""

import cv2
import numpy as np
import pytest

from data.report.frame_images import (
    MAX_FRAMES,
    MAX_IMAGE_BYTES,
    ImageCollection,
    read_frame_images,
    write_panels,
)
from perception.errors import ImageError
from perception.render.panels import PanelArea
from tests.data.report.conftest import COLORS, PANELS, write_video
from tests.faults import fault


def decoded(image):
    return cv2.imdecode(np.frombuffer(image, np.uint8), cv2.IMREAD_COLOR)


def noise(size_px, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (*size_px, 3), np.uint8)


def test_images_are_the_panels_of_the_video(run_folder):
    found = read_frame_images(run_folder, PANELS, frames=3)
    assert found.views == ("Camera", "From above")
    assert found.sizes_px == [(400, 120), (236, 300)]
    assert list(found.images) == [0, 1, 2]
    for value, (camera, above) in zip(COLORS, found.images.values(), strict=True):
        assert decoded(camera).shape == (120, 400, 3)
        assert abs(int(decoded(camera).mean()) - value) < 4
        assert abs(int(decoded(above).mean()) - value // 2) < 4


def test_without_panels_the_whole_image_is_shown(run_folder):
    found = read_frame_images(run_folder, {}, frames=3)
    assert (found.views, found.sizes_px) == (("Video",), [(640, 360)])
    assert decoded(found.images[0][0]).shape == (360, 640, 3)


def test_a_run_that_stopped_has_the_images_so_far(run_folder):
    (run_folder / "video.mp4").rename(run_folder / "video.partial.mp4")
    assert len(read_frame_images(run_folder, PANELS, frames=9).images) == 3


def test_panels_stand_in_for_a_video(tmp_path):
    for row in (0, 2):
        panels = {"3D, from behind": noise((20, 40), row), "From above": noise((30, 10), row)}
        write_panels(tmp_path, row, panels)
    found = read_frame_images(tmp_path, PANELS, frames=3)
    assert found.views == ["3d", "From above"]
    assert found.sizes_px == [(40, 20), (10, 30)]
    assert [len(images) for images in found.images.values()] == [2, 2]


def test_there_may_be_no_images(tmp_path):
    assert read_frame_images(tmp_path, PANELS, frames=3).images == {}


def test_images_stay_within_the_limit_and_spread_over_the_drive():
    collection = ImageCollection(100, max_bytes=60_000)
    for row in range(100):
        if collection.takes(row):
            collection.add(row, [noise((60, 80), row)])
    sizes = [sum(map(len, images)) for images in collection.images.values()]
    assert 20_000 < sum(sizes) <= 60_000
    rows = list(collection.images)
    assert set(np.diff(rows)) == {collection.step}
    assert rows[0] == 0
    assert rows[-1] + collection.step >= 100


def test_a_long_drive_shows_every_nth_frame():
    collection = ImageCollection(10 * MAX_FRAMES)
    assert [collection.takes(row) for row in (0, 1, 9, 10)] == [True, False, False, True]


def test_150_frames_of_a_video_are_all_kept():
    """Noise compresses to about three times the size of an image of a drive."""
    collection, panels = ImageCollection(150), [noise((195, 640))]
    for row in range(150):
        collection.add(row, panels)
    assert len(collection.images) == 150
    assert sum(len(one[0]) for one in collection.images.values()) <= MAX_IMAGE_BYTES


def test_a_damaged_video_is_an_error(run_folder):
    (run_folder / "video.mp4").write_bytes(b"no video")
    with fault(ImageError, where="video.mp4", expected="a video", advice="remove it"):
        read_frame_images(run_folder, PANELS, frames=3)


def test_a_damaged_panel_is_an_error(tmp_path):
    write_panels(tmp_path, 0, {"Camera": noise((20, 40))})
    (path,) = (tmp_path / "panels").iterdir()
    path.write_bytes(b"no image")
    with fault(ImageError, path.name, expected="a whole PNG or JPEG image", advice="--overwrite"):
        read_frame_images(tmp_path, {}, frames=1)


@pytest.mark.parametrize("area", [PanelArea(1, 2, 5, 8)])
def test_a_panel_is_an_area_of_an_image(area):
    image = np.arange(300, dtype=np.uint8).reshape(10, 10, 3)
    assert area.size_px == (4, 6)
    np.testing.assert_array_equal(area.of(image), image[2:8, 1:5])


def test_the_video_is_read_once(run_folder):
    write_video(run_folder)
    assert len(read_frame_images(run_folder, PANELS, frames=2 * MAX_FRAMES).images) == 2
