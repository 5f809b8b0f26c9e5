import numpy as np
import pytest

from perception.geometry.grids import LocalArea
from perception.geometry.se3 import from_euler
from perception.render import palette
from perception.render.birds_eye import (
    BirdsEyeView,
    draw_birds_eye,
    draw_occupancy,
    draw_squares,
    view_of_area,
)
from perception.render.overlay import sample_surface
from perception.render.palette import GROUND_POINTS, MOVING, PANEL, POINTS
from perception.types import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from tests.render.conftest import voxels_at

VIEW = BirdsEyeView(size_px=(200, 300), pixels_per_m=10.0, vehicle_px=(100.0, 250.0))


def birds_eye(view, scene):
    canvas = np.empty((*view.size_px[::-1], 3), np.uint8)
    draw_birds_eye(canvas, view, scene, sample_surface(scene.ground, LocalArea()))
    return canvas


def test_metres_become_pixels_with_ahead_up_and_left_left():
    metres = np.array([(0, 0), (10, 0), (0, 5), (-2, -3)], float)
    np.testing.assert_allclose(
        VIEW.to_pixels(metres), [(100, 250), (100, 150), (50, 250), (130, 270)]
    )


def test_an_area_is_fitted_and_centred():
    view = view_of_area(LocalArea(), (300, 600))
    # 30 m x 20 m into 600 x 300 pixels: 15 a metre, and 75 rows spare at either end.
    assert view.pixels_per_m == 15
    np.testing.assert_allclose(
        view.to_pixels(np.array([(25.0, 10.0), (-5.0, -10.0)])), [(0, 75), (300, 525)]
    )


def test_a_voxel_covers_its_footprint_only():
    canvas = np.zeros((300, 200, 3), np.uint8)
    draw_squares(canvas, VIEW, voxels_at((10, 0, 0), size_m=0.3), np.array([MOVING], np.uint8))
    rows, columns = np.nonzero(canvas.any(axis=2))
    assert set(rows) == {149, 150, 151}
    assert set(columns) == {99, 100, 101}
    assert (canvas[150, 100] == MOVING).all()


def test_voxels_beyond_the_canvas_are_left_out():
    canvas = np.zeros((300, 200, 3), np.uint8)
    draw_squares(
        canvas, VIEW, voxels_at((90, 0, 0), (0, 90, 0), (-9, 0, 0)), np.array([MOVING], np.uint8)
    )
    assert not canvas.any()


def test_points_of_each_state_are_drawn_at_their_places(scene):
    canvas = birds_eye(VIEW, scene)
    column, row = VIEW.to_pixels(np.array([[12.0, 1.0]]))[0].astype(int)
    assert (canvas[row, column] == MOVING).all()
    column, row = VIEW.to_pixels(np.array([[10.0, -1.0]]))[0].astype(int)
    red, green, blue = canvas[row, column].astype(int)
    assert red > 2 * max(green, blue)
    assert (canvas[170, 80] == GROUND_POINTS).all()
    # 25 m ahead the local area ends, here above the canvas; behind the vehicle at 5 m.
    assert (canvas[299, 5] == canvas[240, 5]).all()


def test_points_outside_the_area_are_grey_on_the_panel(scene):
    far_view = BirdsEyeView((200, 300), 5.0, (100.0, 250.0))
    canvas = birds_eye(far_view, scene)
    assert (canvas[35, 85] == POINTS).all()
    assert (canvas[60, 20] == PANEL).all()


def test_free_and_occupied_cells_are_tinted_where_they_are_in_the_world():
    # The vehicle at (100, 50) looks along y of the world: ahead is y, to the right x.
    pose = from_euler(0, 0, np.pi / 2, np.array([100.0, 50, 0]))
    states = np.full((20, 10), UNKNOWN, np.int8)
    states[10, 0], states[12, 9] = FREE, OCCUPIED
    grid = OccupancyGrid(states, np.array([97.5, 50, -1.7]), cell_m=0.5)
    canvas = np.full((300, 200, 3), 200, np.uint8)
    draw_occupancy(canvas, VIEW, grid, pose)
    # Cell centres (97.75, 55.25) and (102.25, 56.25): 5.25 m ahead and 2.25 m left, 6.25 m and 2.25 m right.
    for (x_m, y_m), color in (((5.25, 2.25), palette.FREE), ((6.25, -2.25), palette.OCCUPIED)):
        column, row = VIEW.to_pixels(np.array([[x_m, y_m]]))[0].astype(int)
        expected = 0.55 * 200 + 0.45 * np.array(color)
        assert canvas[row, column] == pytest.approx(expected, abs=1)
    assert (canvas != 200).any(axis=2).sum() == pytest.approx(2 * 25, abs=11)
