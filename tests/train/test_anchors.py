import numpy as np
import pytest

from perception.errors import LabelError
from tests.faults import fault
from train.detector.anchors import fit_anchors, shape_iou


def test_overlap_of_shapes_by_hand():
    # 10 x 10 within 20 x 10: a half; 20 x 10 with 10 x 20: 100 of 300.
    overlaps = shape_iou(np.array([[20.0, 10.0]]), np.array([[10.0, 10.0], [10.0, 20.0]]))
    np.testing.assert_allclose(overlaps, [[1 / 2, 1 / 3]])


def test_three_heaps_are_found():
    rng = np.random.default_rng(0)
    centers = np.array([[10.0, 8.0], [40.0, 20.0], [90.0, 120.0]])
    sizes_px = np.concatenate([center * rng.uniform(0.95, 1.05, (50, 2)) for center in centers])
    fit = fit_anchors(sizes_px, 3, rng)
    np.testing.assert_allclose(fit.anchors_px, centers, rtol=0.02)
    assert fit.mean_iou > 0.93


def test_one_anchor_is_the_mean():
    sizes_px = np.array([[10.0, 10.0], [20.0, 10.0], [30.0, 40.0]])
    fit = fit_anchors(sizes_px, 1, np.random.default_rng(0))
    np.testing.assert_allclose(fit.anchors_px, [[20, 20]])
    # 100 / 400, 200 / 400, 400 / 1200
    assert fit.mean_iou == pytest.approx((1 / 4 + 1 / 2 + 1 / 3) / 3)


def test_as_many_anchors_as_sizes_fit_exactly():
    sizes_px = np.array([[1.0, 1.0], [1.0, 1.0], [5.0, 1.0], [9.0, 9.0]])
    fit = fit_anchors(sizes_px, 3, np.random.default_rng(1))
    np.testing.assert_allclose(fit.anchors_px, [[1, 1], [5, 1], [9, 9]])
    assert fit.mean_iou == pytest.approx(1)


@pytest.mark.parametrize("seed", range(20))
def test_no_anchor_is_left_without_labels(seed):
    rng = np.random.default_rng(seed)
    sizes_px = np.round(rng.uniform(1, 6, (12, 2)))
    fit = fit_anchors(sizes_px, 6, rng)
    assert set(shape_iou(sizes_px, fit.anchors_px).argmax(axis=1)) == set(range(6))
    assert np.isfinite(fit.anchors_px).all()


def test_the_seed_decides():
    sizes_px = np.random.default_rng(5).uniform(1, 100, (200, 2))
    first, second = (fit_anchors(sizes_px, 5, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(first.anchors_px, second.anchors_px)


def test_more_anchors_fit_better():
    sizes_px = np.random.default_rng(5).uniform(5, 100, (200, 2))
    fits = [fit_anchors(sizes_px, count, np.random.default_rng(0)).mean_iou for count in (1, 3, 9)]
    assert fits == sorted(fits)


@pytest.mark.parametrize(
    ("sizes_px", "expected", "found"),
    [
        (np.zeros((0, 2)), "at least 2 different ones for 2 anchors", "0"),
        (np.ones((9, 2)), "at least 2 different ones for 2 anchors", "1"),
        (np.array([[4.0, 0.0], [1, 1], [2, 2]]), "widths and heights over zero", ""),
        (np.array([[4.0, np.nan], [1, 1], [2, 2]]), "widths and heights over zero", ""),
    ],
)
def test_sizes_that_cannot_be_used(sizes_px, expected, found):
    with fault(LabelError, expected=expected, found=found):
        fit_anchors(sizes_px, 2, np.random.default_rng(0))
