import numpy as np
import pytest

from perception.geometry.box_overlap import (
    intersection_areas_m2,
    iou_3d,
    paired_intersection_areas_m2,
    paired_iou_3d,
)
from perception.types import Boxes3D


def box(x: float, y: float, z: float, size: tuple[float, ...], yaw: float = 0.0) -> Boxes3D:
    return Boxes3D(np.array([[x, y, z]]), np.array([size]), np.array([yaw]))


CAR = (4.0, 2.0, 1.5)


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        (box(10, 3, -1.7, CAR, 0.4), 1.0),
        (box(10, 3, -1.7, CAR, 0.4 + np.pi), 1.0),  # the other way round is the same volume
        (box(10, 3, -1.2, CAR, 0.4), 1.0 / 2.0),  # 0.5 m higher: 1.0 of 2.0 m of height
        (box(10, 3, -1.7, (4.0, 2.0, 0.75), 0.4), 0.5),
        (box(10, 3, -1.45, (2.0, 1.0, 0.75), 0.4), 1.5 / 12),  # within
        (box(10, 3, -0.2, CAR, 0.4), 0.0),  # on top: they touch
        (box(10, 3, 5.0, CAR, 0.4), 0.0),  # far above: nothing negative comes out
        (box(10, 9, -1.7, CAR, 0.4), 0.0),
        (box(10, 3, -1.7, (0.0, 0.0, 0.0)), 0.0),
    ],
)
def test_volumes_that_one_can_count(other: Boxes3D, expected: float):
    truth = box(10, 3, -1.7, CAR, 0.4)
    assert paired_iou_3d(truth, other)[0] == pytest.approx(expected)
    assert paired_iou_3d(other, truth)[0] == pytest.approx(expected)


def test_a_quarter_turn_leaves_the_square_in_the_middle():
    overlap = paired_iou_3d(box(0, 0, 0, CAR), box(0, 0, 0, CAR, np.pi / 2))[0]
    assert overlap == pytest.approx(4 / 12)


def test_a_car_survives_a_shift_of_two_metres_at_a_quarter():
    # (3.9 - 2.34) / (3.9 + 2.34) is a quarter.
    size = (3.9, 1.6, 1.5)
    assert paired_iou_3d(box(0, 0, 0, size), box(2.34, 0, 0, size))[0] == pytest.approx(0.25)


def test_volumes_of_two_boxes_without_any_have_no_overlap():
    nothing = box(0, 0, 0, (0.0, 0.0, 0.0))
    assert paired_iou_3d(nothing, nothing).tolist() == [0.0]


def test_what_is_nan_stays_nan_in_its_row():
    boxes = Boxes3D(np.zeros((2, 3)), np.ones((2, 3)), np.zeros(2))
    others = Boxes3D(np.array([[np.nan] * 3, [0, 0, 0]]), np.ones((2, 3)), np.zeros(2))
    overlap = paired_iou_3d(boxes, others)
    assert np.isnan(overlap[0])
    assert overlap[1] == pytest.approx(1.0)


def test_pairs_are_the_diagonal_of_all_with_all():
    rng = np.random.default_rng(4)
    a, b = (
        Boxes3D(rng.uniform(-2, 2, (20, 3)), rng.uniform(0.5, 5, (20, 3)), rng.uniform(-4, 4, 20))
        for _ in range(2)
    )
    np.testing.assert_allclose(
        paired_intersection_areas_m2(a, b), np.diag(intersection_areas_m2(a, b)), atol=1e-12
    )
    np.testing.assert_allclose(paired_iou_3d(a, b), np.diag(iou_3d(a, b)), atol=1e-12)
    assert (np.diag(intersection_areas_m2(a, b)) > 0).sum() > 5
