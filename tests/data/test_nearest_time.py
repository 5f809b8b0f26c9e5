"""Data of two clocks are joined by time, each scan to what is nearest to it."""

import numpy as np
import pytest

from data.nearest_time import half_period_s, nearest_in_time

SCANS_S = np.array([0.0, 0.1, 0.2, 0.3])


def test_the_nearest_is_taken_whatever_the_rate():
    images_s = np.arange(0.0, 0.31, 1 / 30) + 0.004
    assert nearest_in_time(SCANS_S, images_s).tolist() == [0, 3, 6, 9]


def test_what_is_farther_than_half_a_period_is_not_near():
    assert nearest_in_time(SCANS_S, np.array([0.12, 0.36])).tolist() == [-1, 0, -1, -1]
    assert nearest_in_time(SCANS_S, np.array([0.12, 0.36]), 0.1).tolist() == [-1, 0, 0, 1]


def test_order_and_unknown_times_do_not_matter():
    assert nearest_in_time(SCANS_S, np.array([0.3, np.nan, 0.1])).tolist() == [-1, 2, -1, 0]
    with_unknown_s = np.array([0.0, np.nan, 0.2])
    assert nearest_in_time(with_unknown_s, SCANS_S).tolist() == [0, -1, 2]


def test_of_two_as_near_the_earlier_is_taken():
    assert nearest_in_time(np.array([0.5]), np.array([1.0, 0.0])).tolist() == [1]


def test_without_times_no_index_is_near():
    assert nearest_in_time(SCANS_S, np.zeros(0)).tolist() == [-1] * 4
    assert nearest_in_time(SCANS_S, np.array([np.nan])).tolist() == [-1] * 4


def test_half_a_period_is_the_median_one():
    assert half_period_s(np.array([0.0, 0.1, 0.2, 0.9])) == pytest.approx(0.05)
    assert half_period_s(np.array([3.0])) == np.inf
