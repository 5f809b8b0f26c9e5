import numpy as np

from perception.geometry.camera import project_segments

# Looks along +z; a pixel is 1 cm at 1 m.
IMAGE_P_CAM = np.array([[100.0, 0, 100, 0], [0, 100.0, 50, 0], [0, 0, 1, 0]])
SIZE_PX = (200, 100)


def project(*segments, **limits):
    return project_segments(IMAGE_P_CAM, np.array(segments, float), **limits)


def test_what_is_in_view_is_projected_as_points_are():
    seen = project([(0, 0, 1), (0.5, 0.25, 1)], size_px=SIZE_PX)
    assert seen.rows.tolist() == [0]
    np.testing.assert_allclose(seen.ends_px, [[(100, 50), (150, 75)]])


def test_a_line_that_passes_the_camera_ends_before_it():
    # From 4 m ahead to 4 m behind, 1 m to the right: at 0.3 m it is at 100 + 100 / 0.3.
    seen = project([(1, 0, 4), (1, 0, -4)])
    np.testing.assert_allclose(seen.ends_px, [[(125, 50), (100 + 100 / 0.3, 50)]])


def test_within_an_image_it_ends_where_the_image_does():
    seen = project([(1, 0, 4), (1, 0, -4)], [(-9, 0, 1), (9, 0, 1)], size_px=SIZE_PX)
    np.testing.assert_allclose(
        seen.ends_px, [[(125, 50), (199, 50)], [(0, 50), (199, 50)]], atol=1e-9
    )


def test_what_is_behind_or_beside_is_left_out():
    behind, beside, ahead = [(0, 0, -1), (1, 0, -3)], [(5, 0, 1), (9, 3, 1)], [(0, 0, 2), (0, 1, 3)]
    # Its ends are left of the image and over it; the line between them cuts no part of it.
    corner = [(-1.5, -0.2, 1), (-0.7, -1.0, 1)]
    seen = project(behind, beside, ahead, corner, size_px=SIZE_PX)
    assert seen.rows.tolist() == [2]


def test_random_lines_never_leave_the_image():
    segments = np.random.default_rng(1).uniform(-8, 8, (500, 2, 3))
    seen = project_segments(IMAGE_P_CAM, segments, SIZE_PX, margin_px=3.0)
    assert 50 < len(seen) < 500
    low, high = seen.ends_px.min(axis=(0, 1)), seen.ends_px.max(axis=(0, 1))
    assert (low >= -3 - 1e-6).all()
    assert (high <= (202 + 1e-6, 102 + 1e-6)).all()


def test_no_lines_are_no_lines():
    assert len(project_segments(IMAGE_P_CAM, np.zeros((0, 2, 3)), SIZE_PX)) == 0
