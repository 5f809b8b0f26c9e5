import numpy as np
import pytest

from perception.geometry.sorting import sorted_keys


@pytest.mark.parametrize("farthest", [3, 10**6, 2**40, 2**62])
@pytest.mark.parametrize("lowest", [0, -(2**61), 2**58 + 7])
def test_same_as_a_stable_sort_of_indices(farthest, lowest):
    generator = np.random.default_rng(5)
    keys = lowest + generator.integers(0, farthest, 500)
    keys[100:200] = keys[:100]
    ordered, order = sorted_keys(keys)
    np.testing.assert_array_equal(order, np.argsort(keys, kind="stable"))
    np.testing.assert_array_equal(ordered, np.sort(keys))


def test_small_numbers_do_not_overflow():
    keys = np.array([2**31 - 1, -(2**31), 5], np.int32)
    ordered, order = sorted_keys(keys)
    assert ordered.tolist() == [-(2**31), 5, 2**31 - 1]
    assert order.tolist() == [1, 2, 0]


def test_none_and_one():
    assert [part.tolist() for part in sorted_keys(np.zeros(0, np.int64))] == [[], []]
    assert [part.tolist() for part in sorted_keys(np.array([-7]))] == [[-7], [0]]
