"""Sixteen beams, far apart in the image."""

import numpy as np
import pytest

from benchmarks.maps import held_out_errors
from data.synthetic.drive import SyntheticDrive
from perception.maps.densify import ColumnFillingConfig, densify, fill_columns
from perception.maps.filling import region_of_interest
from perception.maps.projection import SparseMaps, project_frame
from perception.sensor import VLP_16
from tests.reference.maps import fill_columns_by_loop


@pytest.fixture(scope="module")
def sparse():
    return project_frame(SyntheticDrive(frames=1, sensor=VLP_16, images=False)[0])


def test_sixteen_beams_fill_all_below_their_highest_returns(sparse):
    assert 2000 < len(sparse) < 8000
    dense = densify(sparse)
    is_inside = region_of_interest(sparse)
    # Columns are filled in pairs.
    is_inside[:, :-1:2] |= is_inside[:, 1::2]
    is_inside[:, 1::2] |= is_inside[:, :-1:2]
    is_inside[: sparse.pixels[:, 1].min()] = False
    assert (dense.is_valid == is_inside).all()
    valid_m = dense.depth_m[dense.is_valid]
    # Along lines between returns, and never past them.
    assert valid_m.min() >= 0.999 * sparse.depth_m.min()
    assert valid_m.max() <= 1.001 * sparse.depth_m.max()


def test_part_of_sixteen_beams_equals_a_loop(sparse):
    left, width = 400, 90
    column = sparse.pixels[:, 0] - left
    part = sparse[(column >= 0) & (column < width)]
    shifted = SparseMaps(
        part.pixels - [left, 0], part.depth_m, part.reflectance, (width, sparse.size_px[1])
    )
    config = ColumnFillingConfig()
    fast, reference = fill_columns(shifted, config), fill_columns_by_loop(shifted, config)
    assert (fast.depth_m > 0).any()
    np.testing.assert_allclose(fast.depth_m, reference.depth_m, rtol=2e-5)
    np.testing.assert_allclose(fast.reflectance, reference.reflectance, atol=2e-6)


def test_default_predicts_held_out_returns_best(sparse):
    # Few returns are left out of so few: which method errs less changes from scan to scan.
    errors = held_out_errors([sparse], np.random.default_rng(0))["Trifuse"]
    assert len(errors.depth_m) > 200
    assert errors.depth_m.mean() < 0.8
    assert errors.is_close.mean() > 0.92
    assert errors.reflectance.mean() < 0.08
