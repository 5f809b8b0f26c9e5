from dataclasses import replace

import numpy as np
import pytest

from perception.errors import UsageError
from perception.render.composition import Composition
from perception.types import Obstacles
from tests.render.conftest import voxels_at

SMALL = Composition(size_px=(800, 450))


def test_the_picture_has_the_size_that_was_asked_for(scene):
    assert SMALL.draw(scene).shape == (450, 800, 3)
    assert Composition().draw(scene).shape == (900, 1600, 3)


def test_the_size_stays_without_a_camera(scene):
    blind = replace(scene, frame=replace(scene.frame, image=None, calibration=None))
    assert SMALL.draw(blind).shape == (450, 800, 3)


def test_a_tall_image_fits_too(scene):
    calibration = replace(scene.frame.calibration, image_size_px=None)
    image = np.full((900, 400, 3), 128, np.uint8)
    tall = replace(scene, frame=replace(scene.frame, image=image, calibration=calibration))
    assert SMALL.draw(tall).shape == (450, 800, 3)


def test_the_same_picture_twice(scene):
    np.testing.assert_array_equal(SMALL.draw(scene), SMALL.draw(scene))


def test_no_obstacles_and_no_timings_are_a_picture_too(scene):
    states = np.zeros(4, np.uint8)
    empty = replace(scene, obstacles=Obstacles(states, voxels_at(), voxels_at()), timings_s={})
    assert SMALL.draw(empty).shape == (450, 800, 3)


def test_moving_voxels_make_green_pixels_in_every_panel(scene):
    without = replace(scene, obstacles=replace(scene.obstacles, moving=voxels_at()))
    changed = (SMALL.draw(scene) != SMALL.draw(without)).any(axis=2)
    rows, columns = np.nonzero(changed)
    is_left, is_top = columns < 560, rows < 190
    assert (is_left & is_top).any()
    assert (is_left & ~is_top).any()
    assert (~is_left).any()


@pytest.mark.parametrize("size_px", [(801, 450), (800, 451), (320, 180)])
def test_sizes_that_no_video_can_have_are_refused(size_px):
    with pytest.raises(UsageError) as error:
        Composition(size_px=size_px)
    assert (error.value.where, error.value.found) == ("image size", f"{size_px[0]}x{size_px[1]}")
