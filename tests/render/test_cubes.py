import numpy as np

from perception.render.overlay import render_cubes
from tests.render.conftest import FORWARD_CAMERA, voxels_at

SIZE_PX = (200, 100)


def cube_image(voxels):
    return render_cubes(FORWARD_CAMERA.image_P_velo, SIZE_PX, voxels).cubes


def test_a_cube_lands_on_its_projected_pixel():
    # u = 100 + 100 * 1 / 5, v = 50 + 100 * 0.5 / 5; 0.5 m at 5 m is 10 px, drawn a fifth broader.
    seen = cube_image(voxels_at((5, -1, -0.5), size_m=0.5))
    rows, columns = np.nonzero(seen == 0)
    assert (rows.mean(), columns.mean()) == (59.5, 119.5)
    assert (np.ptp(rows) + 1, np.ptp(columns) + 1) == (12, 12)


def test_the_nearer_cube_is_on_top_in_either_order():
    near, far = (4, 0, 0), (9, 0, 0)
    assert cube_image(voxels_at(near, far))[50, 100] == 0
    assert cube_image(voxels_at(far, near))[50, 100] == 1


def test_a_cube_behind_the_camera_is_not_drawn():
    behind = voxels_at((-5, 0, 0), (-0.2, 0, 0), (0, 0, 0), (0.3, 0, 0))
    assert (cube_image(behind) == -1).all()


def test_cubes_are_cut_at_the_image_border():
    at_the_corner = voxels_at((5, 5, 2.5), size_m=0.5)
    rows, columns = np.nonzero(cube_image(at_the_corner) == 0)
    assert rows.min() == 0
    assert columns.min() == 0
    assert len(rows) == 6 * 6


def test_no_voxels_leave_the_image_empty():
    assert (cube_image(voxels_at()) == -1).all()


def faces_seen(center_m):
    image = render_cubes(FORWARD_CAMERA.image_P_velo, SIZE_PX, voxels_at(center_m, size_m=1.0))
    return set(image.faces[image.is_cube])


def test_a_cube_straight_ahead_shows_its_front():
    assert faces_seen((5, 0, 0)) == {0}


def test_a_cube_beside_and_below_shows_front_side_and_top():
    assert faces_seen((4, 2, -1)) == {0, 1, 2}
    assert faces_seen((4, 2, 0)) == {0, 1}


def test_the_face_is_the_one_that_the_ray_enters():
    voxels = voxels_at((4, 1.5, 0), size_m=1.0)
    image = render_cubes(FORWARD_CAMERA.image_P_velo, SIZE_PX, voxels)
    faces, columns = image.faces[image.is_cube], np.nonzero(image.is_cube)[1]
    # The front's right edge, x = 3.5 and y = 1, projects to u = 100 - 100 / 3.5 = 71.4.
    assert (faces[columns <= 71] == 0).all()
    assert (faces[columns >= 72] == 1).all()
