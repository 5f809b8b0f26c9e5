"""Pairs at the minimum sum of costs, beside SciPy's."""

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from perception.kernels.assignment import minimum_cost_pairs


@pytest.mark.parametrize("shape", [(1, 1), (5, 5), (4, 9), (9, 4), (1, 7), (40, 30), (64, 64)])
def test_pairs_equal_those_of_scipy(shape):
    generator = np.random.default_rng(3)
    for _ in range(20):
        costs = generator.normal(size=shape)
        rows, columns = minimum_cost_pairs(costs)
        expected_rows, expected_columns = linear_sum_assignment(costs)
        np.testing.assert_array_equal(rows, expected_rows)
        np.testing.assert_array_equal(columns, expected_columns)


@pytest.mark.parametrize("shape", [(0, 0), (0, 3), (3, 0)])
def test_a_matrix_without_rows_or_columns_has_no_pairs(shape):
    rows, columns = minimum_cost_pairs(np.zeros(shape))
    assert len(rows) == len(columns) == 0


def test_the_sum_is_smallest_also_where_costs_repeat():
    generator = np.random.default_rng(4)
    for _ in range(200):
        costs = generator.integers(0, 4, (6, 8)).astype(float)
        rows, columns = minimum_cost_pairs(costs)
        assert len(set(columns)) == 6
        assert costs[rows, columns].sum() == costs[linear_sum_assignment(costs)].sum()
