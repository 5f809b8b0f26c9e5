import numpy as np
import pytest
from scipy import ndimage

from perception.datmo.config import THESIS
from perception.datmo.grid_objects import fill_holes, find_objects, join_cells
from tests.reference.datmo import fill_holes_by_flooding


def motion(*blocks, shape=(60, 50)):
    """Return a motion grid with blocks of (first row, first column, rows, columns, height)."""
    motion_m = np.zeros(shape, np.float32)
    for row, column, rows, columns, height_m in blocks:
        motion_m[row : row + rows, column : column + columns] = height_m
    return motion_m


def count(*blocks):
    return find_objects(motion(*blocks), THESIS).count


def test_a_vehicle_in_two_pieces_along_its_length_is_one():
    found = find_objects(motion((10, 20, 6, 8, 1.0), (20, 20, 6, 8, 1.0)), THESIS)
    assert found.count == 1
    assert found.labels[12, 22] == found.labels[17, 23] == found.labels[22, 22] == 1


def test_two_vehicles_side_by_side_are_two():
    found = find_objects(motion((10, 5, 15, 8, 1.0), (10, 30, 15, 8, 1.0)), THESIS)
    assert found.count == 2
    assert {found.labels[15, 8], found.labels[15, 33]} == {1, 2}


def test_one_cell_becomes_what_both_rectangles_cover_and_the_code_adds():
    # 10 x 2 and 2 x 10 share 2 x 2 cells; 9 more along x; then a rim of one cell falls away.
    joined = join_cells(motion((30, 20, 1, 1, 1.0)))
    assert not joined.any()  # two cells across have no core
    joined = join_cells(motion((30, 20, 1, 3, 1.0)))
    rows, columns = np.nonzero(joined)
    assert (np.ptp(rows) + 1, np.ptp(columns) + 1) == (11 - 2, 4 - 2)


def test_what_is_too_low_has_no_core():
    assert count((20, 20, 6, 6, 0.6)) == 0
    assert count((20, 20, 6, 6, 0.8)) == 1


@pytest.mark.parametrize(
    ("block", "kept"),
    [((20, 20, 3, 4, 1.0), 0), ((20, 20, 4, 5, 1.0), 1), ((5, 5, 40, 30, 1.0), 0)],
    ids=["12 cells of motion", "20 cells of motion", "over 15 m2"],
)
def test_implausible_sizes_are_dropped(block, kept):
    assert count(block) == kept


def test_labels_are_renumbered_after_the_filters():
    found = find_objects(motion((2, 2, 1, 3, 1.0), (40, 20, 8, 8, 1.0)), THESIS)
    assert found.count == found.labels.max() == 1
    assert found.joined[2:8, 2:5].any()
    assert not found.labels[2:8, 2:5].any()


def test_no_motion_is_no_object():
    found = find_objects(motion(), THESIS)
    assert found.count == 0
    assert not found.labels.any()


def random_blobs(seed):
    rng = np.random.default_rng(seed)
    smooth = ndimage.gaussian_filter(rng.random((70, 45)), 1.5)
    return np.where(smooth > np.median(smooth), smooth * 3, 0).astype(np.float32)


@pytest.mark.parametrize("seed", range(4))
def test_holes_fill_to_the_level_at_which_they_drain(seed):
    grid = random_blobs(seed)
    filled = fill_holes(grid)
    np.testing.assert_array_equal(filled, fill_holes_by_flooding(grid))
    np.testing.assert_array_equal(filled > 0, ndimage.binary_fill_holes(grid > 0))
    assert (filled > grid).any()
