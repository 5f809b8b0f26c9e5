import numpy as np

from perception.geometry.grids import LocalArea
from perception.render.overlay import OverlayStyle, draw_overlay, sample_surface
from perception.render.palette import GROUND, MOVING, STATIC
from perception.types import Obstacles
from tests.render.conftest import FORWARD_CAMERA, voxels_at

OPAQUE = OverlayStyle(cube_opacity=1.0, ground_opacity=1.0, mesh_opacity=0.0)
NOTHING = voxels_at()


def overlay(scene, static=NOTHING, moving=NOTHING, style=OPAQUE):
    surface = sample_surface(scene.ground, LocalArea())
    obstacles = Obstacles(np.zeros(4, np.uint8), static, moving)
    canvas = scene.frame.image.copy()
    draw_overlay(canvas, FORWARD_CAMERA.image_P_velo, surface, obstacles, style)
    return canvas


def is_tinted(pixel, color):
    """The pixel is the colour, darker only where a face is turned from the light."""
    share = pixel / np.array(color)
    return share.min() > 0.5 and share.max() <= 1.0 and np.ptp(share) < 0.05


def test_static_is_red_and_moving_is_green(scene):
    image = overlay(scene, voxels_at((10, -1, 0)), voxels_at((10, 1, 0)))
    assert is_tinted(image[50, 110], STATIC)
    assert is_tinted(image[50, 90], MOVING)
    assert (image[50, 100] == 128).all()


def test_the_ground_is_blue_up_to_the_end_of_the_area(scene):
    image = overlay(scene)
    # The far edge, 25 m ahead and 1.73 m below, projects to v = 50 + 100 * 1.73 / 25 = 56.9.
    assert (image[:56] == 128).all()
    red, _, blue = image[60:95, 60:140].reshape(-1, 3).astype(int).T
    assert (blue > red + 60).all()
    # Bare of the mesh's lines it has exactly the palette's blue.
    assert (image[60:95] == GROUND).all(axis=2).any()


def test_an_obstacle_hides_the_ground_behind_it(scene):
    image = overlay(scene, voxels_at((4, 0, -1.0), size_m=0.3))
    assert is_tinted(image[75, 100], STATIC)


def test_the_image_shows_through(scene):
    half = OverlayStyle(cube_opacity=0.5)
    solid = overlay(scene, voxels_at((10, -1, 0)))[50, 110].astype(float)
    mixed = overlay(scene, voxels_at((10, -1, 0)), style=half)[50, 110]
    np.testing.assert_allclose(mixed, (solid + 128) / 2, atol=1)


def test_drawing_is_deterministic(scene):
    np.testing.assert_array_equal(
        overlay(scene, voxels_at((10, -1, 0))), overlay(scene, voxels_at((10, -1, 0)))
    )


def test_the_mesh_of_a_wide_area_has_cells_of_2_m(scene):
    mesh = sample_surface(scene.ground, LocalArea(50.0, 50.0, 10.0))
    assert np.diff(mesh.x_m).tolist() == [2.0] * 50
    assert np.diff(mesh.y_m).tolist() == [1.0] * 20
