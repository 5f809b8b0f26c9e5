import numpy as np
import pytest

from perception.geometry.camera import box_outlines_px
from perception.types import Boxes3D

# x forward, y left, z up; 100 px focal length, image centre at (100, 50).
P = np.array([[100.0, -100, 0, 0], [50, 0, -100, 0], [1, 0, 0, 0]])
SIZE = (201, 101)


def cube(x: float, y: float, z: float) -> Boxes3D:
    return Boxes3D(np.array([[x, y, z]]), np.full((1, 3), 2.0), np.zeros(1))


def test_the_nearest_face_is_the_outline():
    # The front face of the cube stands 10 m away: 100 px/m / 10 m = 10 px a metre.
    assert box_outlines_px(P, cube(11, 0, -1), SIZE)[0] == pytest.approx([90, 40, 110, 60])


def test_it_is_clipped_to_the_image_as_labels_are():
    aside = cube(11, 9.5, -1)  # 8.5 m to 10.5 m to the left at 10 m: -5 px to 17.5 px
    assert box_outlines_px(P, aside)[0] == pytest.approx([-5, 40, 100 - 850 / 12, 60])
    assert box_outlines_px(P, aside, SIZE)[0] == pytest.approx([0, 40, 100 - 850 / 12, 60])


@pytest.mark.parametrize("hidden", [cube(-9, 0, -1), cube(11, 40, -1), cube(np.nan, 0, 0)])
def test_what_is_not_in_the_image_has_no_outline(hidden: Boxes3D):
    assert np.isnan(box_outlines_px(P, hidden, SIZE)).all()


def test_a_box_around_the_camera_fills_the_image():
    bus = Boxes3D(np.array([[0.0, 0, -1]]), np.array([[12.0, 2, 2]]), np.zeros(1))
    assert box_outlines_px(P, bus, SIZE)[0] == pytest.approx([0, 0, 200, 100])


def test_each_box_keeps_its_row():
    boxes = Boxes3D(
        np.array([[np.nan, 0, 0], [11, 0, -1], [-9, 0, -1]]), np.full((3, 3), 2.0), np.zeros(3)
    )
    known = np.isfinite(box_outlines_px(P, boxes, SIZE)).all(axis=1)
    assert known.tolist() == [False, True, False]
    assert box_outlines_px(P, Boxes3D.empty(), SIZE).shape == (0, 4)
