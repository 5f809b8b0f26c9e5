from dataclasses import replace

import numpy as np
import pytest

from perception.errors import UsageError
from perception.render.composition import Composition
from perception.render.panels import left_column_px
from perception.render.scene import Scene, SceneObjects
from perception.types import Boxes3D, CameraImage, Obstacles, Tracks
from tests.render.conftest import voxels_at

SMALL = Composition(size_px=(800, 450))


def drawn(result):
    return SMALL.draw(Scene.of(result))


def test_the_image_has_the_given_size(scene):
    assert drawn(scene).shape == (450, 800, 3)
    assert Composition().draw(Scene.of(scene)).shape == (900, 1600, 3)


def test_the_size_stays_without_a_camera(scene):
    blind = replace(scene, frame=replace(scene.frame, image=None, calibration=None))
    assert drawn(blind).shape == (450, 800, 3)


def test_a_tall_image_fits_too(scene):
    calibration = replace(scene.frame.calibration, image_size_px=None)
    image = np.full((900, 400, 3), 128, np.uint8)
    tall = replace(scene, frame=replace(scene.frame, image=image, calibration=calibration))
    assert drawn(tall).shape == (450, 800, 3)


def test_the_two_main_panels_are_those_of_the_image(scene):
    whole, alone = drawn(scene), SMALL.draw_main_panels(Scene.of(scene))
    areas = SMALL.main_panels(scene)
    assert list(areas) == list(alone) == ["Camera", "From above"]
    for name, area in areas.items():
        np.testing.assert_array_equal(area.of(whole), alone[name])


def test_without_a_camera_the_scene_in_3d_is_the_first_panel(scene):
    blind = replace(scene, frame=replace(scene.frame, image=None, calibration=None))
    first, above = SMALL.draw_main_panels(Scene.of(blind)).items()
    assert (first[0], above[0]) == ("3D, from behind the vehicle", "From above")
    np.testing.assert_array_equal(SMALL.main_panels(blind)[first[0]].of(drawn(blind)), first[1])


def test_drawing_is_deterministic(scene):
    np.testing.assert_array_equal(drawn(scene), drawn(scene))


def test_no_obstacles_and_no_timings_are_drawn_too(scene):
    states = np.zeros(4, np.uint8)
    empty = replace(scene, obstacles=Obstacles(states, voxels_at(), voxels_at()), timings_s={})
    assert drawn(empty).shape == (450, 800, 3)


def test_moving_voxels_make_green_pixels_in_every_panel(scene):
    without = replace(scene, obstacles=replace(scene.obstacles, moving=voxels_at()))
    changed = (drawn(scene) != drawn(without)).any(axis=2)
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


@pytest.mark.parametrize(
    ("camera_px", "column_px", "image_px"),
    [
        ((1242, 375), 1120, 338),  # KITTI: the widest column
        ((1936, 1216), 739, 464),  # 16:10: as high as an image may be
        ((640, 480), 619, 464),
        ((400, 900), 576, 464),  # upright: the narrowest column
    ],
)
def test_the_camera_image_fills_its_column(camera_px, column_px, image_px):
    aspect = camera_px[0] / camera_px[1]
    assert left_column_px((1600, 800), aspect, 0.58) == (column_px, image_px)


def test_without_a_camera_both_columns_are_filled(scene):
    blind = replace(scene, frame=replace(scene.frame, image=None, calibration=None))
    column_px, image_px = left_column_px((800, 407), None, 0.58)
    assert image_px == 0
    changed = drawn(replace(blind, obstacles=replace(blind.obstacles, moving=voxels_at())))
    columns = np.nonzero((changed != drawn(blind)).any(axis=(0, 2)))[0]
    assert columns.min() < column_px < columns.max()


def test_a_camera_of_any_aspect_leaves_no_empty_half(scene):
    for size_px in ((1242, 375), (968, 608), (640, 480)):
        image = np.full((size_px[1], size_px[0], 3), 200, np.uint8)
        calibration = replace(scene.frame.calibration, image_size_px=size_px)
        frame = replace(scene.frame, image=image, calibration=calibration)
        canvas = drawn(replace(scene, frame=frame))
        column_px, image_px = left_column_px((800, 407), size_px[0] / size_px[1], 0.58)
        bright = (canvas[:image_px, :column_px] == 200).all(axis=2)
        # Ground, title and voxels cover the rest.
        assert bright[:, [2, -3]].mean() > 0.3


def with_further_cameras(scene, images):
    further = tuple(
        CameraImage(f"camera_{number}", scene.frame.calibration, image)
        for number, image in enumerate(images)
    )
    return replace(scene, frame=replace(scene.frame, camera="front", further_cameras=further))


def test_each_camera_has_a_cell_of_the_same_size(scene):
    image = np.full_like(scene.frame.image, 250)
    several = with_further_cameras(scene, [image, image, None])
    grid = SMALL.camera_grid(several)
    area = SMALL.main_panels(several)["Camera"]
    cells = grid.cells(area.size_px)
    assert (grid.columns, grid.rows) == (2, 2)
    assert len({cell.size_px for cell in cells}) == 1
    panel = SMALL.draw_main_panels(Scene.of(several))["Camera"]
    bright = [(cell.of(panel) == 250).all(axis=2).mean() for cell in cells]
    assert min(bright[1:3]) > 0.2
    assert max(bright[0], bright[3]) < 0.05
    np.testing.assert_array_equal(area.of(drawn(several)), panel)


def test_the_image_of_a_single_camera_fills_its_panel(scene):
    grid = SMALL.camera_grid(scene)
    assert [cell.size_px for cell in grid.cells((300, 100))] == [(300, 100)]


def test_a_rectangle_is_drawn_in_the_image_of_its_camera_alone(scene):
    image = np.full_like(scene.frame.image, 128)
    several = with_further_cameras(scene, [image])
    objects = replace(
        SceneObjects.of_tracks(flat_track()),
        boxes_px=np.array([[100.0, 50, 300, 150]]),
        cameras=np.array([1]),
    )
    empty = Scene(several, SceneObjects.empty(), [])
    one = Scene(several, objects, [np.zeros((0, 3))])
    panels = [SMALL.draw_main_panels(each)["Camera"] for each in (empty, one)]
    cells = SMALL.camera_grid(several).cells(SMALL.main_panels(several)["Camera"].size_px)
    changed = [bool((cell.of(panels[0]) != cell.of(panels[1])).any()) for cell in cells]
    assert changed == [False, True]


def flat_track():
    """Return a track of a detection without a 3D box."""
    nowhere = Boxes3D(np.full((1, 3), np.nan), np.full((1, 3), np.nan), np.full(1, np.nan))
    return Tracks.unclassified(np.array([3]), nowhere, np.zeros((1, 2)), np.array([True]))
