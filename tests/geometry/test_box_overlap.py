import cv2
import numpy as np
import pytest

from benchmarks.reference.overlap import Prism, shared_volume, turned_rectangle
from perception.geometry.box_overlap import (
    center_distances_m,
    distance_similarity,
    intersection_areas_m2,
    iou_bev,
    paired_intersection_areas_m2,
    paired_iou_bev,
)
from perception.types import Boxes3D


def box(x_m: float, y_m: float, length_m: float, width_m: float, yaw_rad: float = 0.0) -> Boxes3D:
    return Boxes3D(
        np.array([[x_m, y_m, -1.7]]), np.array([[length_m, width_m, 1.5]]), np.array([yaw_rad])
    )


def random_boxes(count: int, rng: np.random.Generator) -> Boxes3D:
    return Boxes3D(
        np.column_stack([rng.uniform(-4, 4, (count, 2)), np.zeros(count)]),
        rng.uniform(0.3, 6, (count, 3)),
        rng.uniform(-4, 4, count),
    )


def prism(boxes: Boxes3D) -> Prism:
    (x_m, y_m, _), (length_m, width_m, _) = boxes.bottom_m[0], boxes.size_m[0]
    return Prism(turned_rectangle((x_m, y_m), length_m, width_m, boxes.yaw_rad[0]))


def area_by_opencv(a: Boxes3D, b: Boxes3D) -> float:
    rectangles = [
        (
            tuple(boxes.bottom_m[0, :2]),
            tuple(boxes.size_m[0, :2]),
            float(np.degrees(boxes.yaw_rad[0])),
        )
        for boxes in (a, b)
    ]
    _, outline = cv2.rotatedRectangleIntersection(*rectangles)
    return 0.0 if outline is None else float(cv2.contourArea(cv2.convexHull(outline)))


def test_pairs_have_the_overlap_that_all_with_all_have():
    rng = np.random.default_rng(10)
    a, b = random_boxes(200, rng), random_boxes(200, rng)
    np.testing.assert_allclose(paired_iou_bev(a, b), np.diag(iou_bev(a, b)), atol=1e-12)


def test_random_boxes_share_what_opencv_says():
    rng = np.random.default_rng(5)
    a, b = random_boxes(30, rng), random_boxes(25, rng)
    expected = [[area_by_opencv(a[[i]], b[[j]]) for j in range(25)] for i in range(30)]
    shared = intersection_areas_m2(a, b)
    assert (np.array(expected) > 0.1).sum() > 200
    np.testing.assert_allclose(shared, expected, atol=2e-4)  # OpenCV counts in float32
    np.testing.assert_allclose(iou_bev(b, a), iou_bev(a, b).T, atol=1e-9)


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        (box(3, 1, 4, 2, 0.3), box(3, 1, 4, 2, 0.3), 1.0),
        (box(3, 1, 4, 2, 0.3), box(3, 1, 4, 2, 0.3 + np.pi), 1.0),
        (box(0, 0, 4, 2), box(0, 0, 2, 4, np.pi / 2), 1.0),
        (box(0, 0, 4, 2), box(2, 0, 4, 2), 1 / 3),  # half over half
        (box(0, 0, 4, 2), box(4, 0, 4, 2), 0.0),  # side by side
        (box(0, 0, 4, 2), box(90, 0, 4, 2), 0.0),
        (box(0, 0, 4, 4), box(0.5, -0.5, 1, 2, 0.4), 2 / 16),  # one within the other
        # A square and itself turned by 45 degrees share a regular octagon.
        (box(0, 0, 2, 2), box(0, 0, 2, 2, np.pi / 4), 1 / np.sqrt(2)),
    ],
)
def test_closed_forms(a: Boxes3D, b: Boxes3D, expected: float):
    assert iou_bev(a, b)[0, 0] == pytest.approx(expected, abs=1e-9)


def test_random_boxes_share_what_cut_polygons_do():
    rng = np.random.default_rng(8)
    a, b = random_boxes(300, rng), random_boxes(300, rng)
    cut = [shared_volume(*(prism(boxes[[row]]) for boxes in (a, b))) for row in range(300)]
    assert (np.array(cut) > 0).sum() > 100
    assert (np.array(cut) == 0).sum() > 50
    np.testing.assert_allclose(paired_intersection_areas_m2(a, b), cut, atol=1e-9)


@pytest.mark.parametrize("turn_rad", [0.0, 1e-15, 1e-12, 1e-10, 1e-9, 1e-8, 1e-7, 1e-5, 1e-3])
def test_nearly_parallel_boxes_share_what_cut_polygons_do(turn_rad: float):
    rng = np.random.default_rng(9)
    a = random_boxes(100, rng)
    turns = rng.choice([0, np.pi / 2, np.pi, -np.pi / 2], 100) + turn_rad
    b = Boxes3D(a.bottom_m + rng.normal(0, 0.3, (100, 3)), a.size_m, a.yaw_rad + turns)
    cut = [shared_volume(*(prism(boxes[[row]]) for boxes in (a, b))) for row in range(100)]
    np.testing.assert_allclose(paired_intersection_areas_m2(a, b), cut, atol=1e-7)


def test_nearly_equal_headings_are_no_special_case():
    turns = np.array([0.0, 1e-15, 1e-12, 1e-9, 1e-7, 1e-5])
    ious = [iou_bev(box(9, 2, 4, 2, 0.7), box(9, 2, 4, 2, 0.7 + turn))[0, 0] for turn in turns]
    np.testing.assert_allclose(ious, 1.0, atol=2e-5)


def test_boxes_without_area_have_no_overlap():
    line, dot, full = box(0, 0, 4, 0), box(0, 0, 0, 0), box(0, 0, 4, 2)
    for a in (line, dot, full):
        for b in (line, dot):
            assert iou_bev(a, b)[0, 0] == iou_bev(b, a)[0, 0] == 0.0


def test_disjoint_boxes_have_no_overlap():
    rng = np.random.default_rng(11)
    a, b = random_boxes(300, rng), random_boxes(300, rng)
    cut = np.array([shared_volume(*(prism(one[[row]]) for one in (a, b))) for row in range(300)])
    assert (paired_intersection_areas_m2(a, b)[cut == 0] == 0).all()


def test_no_boxes_give_an_empty_table():
    assert iou_bev(Boxes3D.empty(), box(0, 0, 4, 2)).shape == (0, 1)
    assert iou_bev(box(0, 0, 4, 2), Boxes3D.empty()).shape == (1, 0)


def test_distance_becomes_a_similarity():
    distances = center_distances_m(box(0, 0, 4, 2), box(3, 4, 1, 1))
    assert distances.tolist() == [[5.0]]
    likeness = distance_similarity(np.array([0.0, 1.0, 2.0, 9.0]), 2.0)
    assert likeness.tolist() == [1.0, 0.5, 0.0, 0.0]
