import numpy as np

from perception.geometry.box_overlap_px import (
    intersection_px,
    iou_px,
    paired_intersection_px,
    paired_iou_px,
)


def test_pairs_are_the_diagonal_of_all_with_all():
    rng = np.random.default_rng(0)
    a, b = (np.sort(rng.uniform(0, 100, (40, 2, 2)), axis=1).reshape(40, 4) for _ in range(2))
    assert (paired_iou_px(a, b) > 0).sum() > 10
    np.testing.assert_array_equal(paired_iou_px(a, b), np.diag(iou_px(a, b)))
    np.testing.assert_array_equal(paired_intersection_px(a, b), np.diag(intersection_px(a, b)))


def test_pairs_that_can_be_counted_by_eye():
    a = np.array([[0, 0, 10, 10], [0, 0, 10, 10], [5, 5, 5, 9], [0, 0, 4, 4]], float)
    b = np.array([[5, 0, 15, 10], [10, 0, 20, 10], [0, 0, 10, 10], [1, 1, 3, 3]], float)
    np.testing.assert_allclose(paired_iou_px(a, b), [1 / 3, 0, 0, 0.25])
    np.testing.assert_allclose(paired_intersection_px(a, b), [50, 0, 0, 4])
    assert paired_iou_px(a[:0], b[:0]).shape == (0,)
