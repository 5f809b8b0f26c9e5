import statistics

import numpy as np
import pytest

from perception.detection.height_cells import HeightCells


def points(*rows):
    return np.array(rows, np.float32).reshape(-1, 3)


def test_variance_is_that_of_a_sample():
    # 0 and 0.2 m: variance 0.02 over n - 1, 0.01 over n.
    cells = HeightCells.of(points([1.1, 0.1, 0], [1.4, 0.4, 0.2]), 0.5)
    assert cells.has_variance(0.0199).tolist() == [True, True]
    assert cells.has_variance(0.0201).tolist() == [False, False]


def test_a_single_point_does_not_vary():
    cells = HeightCells.of(points([0.2, 0.2, 5], [0.7, 0.2, 9]), 0.5)
    assert cells.has_variance(1e-9).tolist() == [False, False]
    assert cells.has_variance(0).tolist() == [True, True]


def test_cells_are_cut_at_multiples_of_their_edge():
    pair = points([0.49, -0.01, 0], [0.49, 0.01, 1], [-0.01, -0.01, 0], [0.01, -0.02, 1])
    assert HeightCells.of(pair, 0.5).has_variance(0.1).tolist() == [True, False, False, True]


def test_variance_equals_that_of_each_cell_alone():
    generator = np.random.default_rng(0)
    scan = generator.normal(0, (4, 4, 0.1), (600, 3)).astype(np.float32)
    keys = [tuple(key) for key in np.floor(scan[:, :2].astype(float) / 0.7).astype(int).tolist()]
    heights = {
        key: [float(z) for k, z in zip(keys, scan[:, 2], strict=True) if k == key] for key in keys
    }
    expected = [len(heights[k]) > 1 and statistics.variance(heights[k]) >= 0.01 for k in keys]
    has_variance = HeightCells.of(scan, 0.7).has_variance(0.01)
    assert has_variance.tolist() == expected
    assert 50 < has_variance.sum() < 550


def test_lowest_is_sought_so_far_on_each_side():
    scan = points([0.2, 0.2, 1], [1.7, 0.2, 0], [2.2, 0.2, -1], [0.2, 9, -5])
    lowest_around_m = HeightCells.of(scan, 0.5).lowest_around_m(1.5)
    assert lowest_around_m.tolist() == [0, -1, -1, -5]


@pytest.mark.parametrize("count", [0, 1])
def test_few_points_have_cells_too(count):
    cells = HeightCells.of(np.ones((count, 3), np.float32), 0.5)
    assert cells.has_variance(0.01).tolist() == [False] * count
    assert cells.lowest_around_m(1.5).tolist() == [1.0] * count


def test_ground_is_the_mean_of_the_lowest_points_of_the_cells_around():
    x_m = np.arange(0.25, 10, 0.5)
    slope = np.column_stack([x_m, np.zeros(20), 0.1 * x_m])
    body = np.array([[5.25, 0.5, 1.5], [5.25, 0.5, 2.0]])
    cells = HeightCells.of(np.concatenate([slope, body]), 0.5)
    ground_m = cells.ground_around_m(1.5, 0.35)
    np.testing.assert_allclose(ground_m[3:-5], slope[3:-3, 2], atol=1e-9)
    np.testing.assert_allclose(ground_m[-2:], 0.525)


def test_of_a_wall_beside_a_lower_one_the_lowest_point_is_the_ground():
    stairs = np.array([[0.25, 0, 0.0], [1.75, 0, 1.0], [3.25, 0, 2.0]])
    ground_m = HeightCells.of(stairs, 0.5).ground_around_m(1.5, 0.2)
    assert ground_m.tolist() == [0.0, 0.0, 1.0]
