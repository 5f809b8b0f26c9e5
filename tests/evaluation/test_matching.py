"""The heaviest matching of few pairs is that of the whole table."""

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from perception.evaluation.multi_object.matching import competing_pairs, max_weight_matching


@pytest.mark.parametrize("share", [0.02, 0.1, 0.5, 1.0])
def test_as_by_one_dense_assignment(share):
    rng = np.random.default_rng(3)
    table = np.where(rng.random((30, 40)) < share, rng.random((30, 40)), 0)
    rows, columns = np.nonzero(table)
    chosen = max_weight_matching(rows, columns, table[rows, columns])
    assert len(set(rows[chosen])) == len(set(columns[chosen])) == chosen.sum()
    best = table[linear_sum_assignment(table, maximize=True)].sum()
    assert table[rows, columns][chosen].sum() == pytest.approx(best)


def test_a_pair_may_give_way_to_two():
    chosen = max_weight_matching(np.array([0, 0, 1]), np.array([0, 1, 0]), np.array([5.0, 4, 4]))
    assert chosen.tolist() == [False, True, True]


def test_only_rivals_come_in_groups_in_the_order_of_their_first_pair():
    rows, columns = np.array([9, 4, 4, 2, 1, 1, 0]), np.array([3, 8, 5, 5, 0, 1, 2])
    assert [group.tolist() for group in competing_pairs(rows, columns)] == [[1, 2, 3], [4, 5]]
    empty = np.zeros(0, int)
    assert competing_pairs(empty, empty) == []
    assert max_weight_matching(empty, empty, np.zeros(0)).tolist() == []
