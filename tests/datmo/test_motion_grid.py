import numpy as np
import pytest

from perception.datmo.grid_objects import motion_grid
from tests.reference.datmo import motion_by_windows


def grids(newest_m, background_m, at=(4, 4), of=(4, 4)):
    """Return E and S of 9 x 9 cells with one height each."""
    height_m, map_m = np.zeros((2, 9, 9), np.float32)
    height_m[at], map_m[of] = newest_m, background_m
    return height_m, map_m


@pytest.mark.parametrize(
    ("newest_m", "background_m", "moves"),
    [
        (1.0, 0.0, True),
        (1.0, 0.85, False),
        (1.0, 0.75, True),
        (1.0, 1.25, True),
        (1.0, 1.15, False),
    ],
)
def test_a_height_moves_where_the_map_differs_by_more_than_its_share(newest_m, background_m, moves):
    motion_m = motion_grid(*grids(newest_m, background_m), alpha=0.2, radius_cells=0)
    assert motion_m[4, 4] == (newest_m if moves else 0)
    assert np.count_nonzero(motion_m) == moves


@pytest.mark.parametrize(
    ("of", "radius", "moves"),
    [((4, 5), 0, True), ((4, 5), 1, False), ((6, 6), 1, True), ((6, 6), 2, False)],
)
def test_a_like_height_nearby_suppresses(of, radius, moves):
    motion_m = motion_grid(*grids(1.0, 1.0, of=of), alpha=0.2, radius_cells=radius)
    assert (motion_m[4, 4] > 0) == moves


@pytest.mark.parametrize("radius", [1, 3, 20])
def test_the_neighbourhood_ends_at_the_border(radius):
    height_m, background_m = grids(1.0, 1.0, at=(0, 0), of=(0, 8))
    expected = 0 if radius >= 8 else 1
    assert motion_grid(height_m, background_m, 0.2, radius)[0, 0] == expected
    # The next row begins where this one ends; they are no neighbours.
    height_m, background_m = grids(1.0, 1.0, at=(3, 8), of=(4, 0))
    expected = 0 if radius >= 8 else 1
    assert motion_grid(height_m, background_m, 0.2, radius)[3, 8] == expected


@pytest.mark.parametrize("alpha", [0.2, 0.3, 1.2])
@pytest.mark.parametrize("radius", [0, 1, 5])
def test_the_fast_form_equals_full_windows(alpha, radius):
    rng = np.random.default_rng(radius)
    height_m, background_m = rng.uniform(-0.5, 2, (2, 40, 25)).astype(np.float32)
    background_m[rng.random((40, 25)) < 0.9] = 0
    motion_m = motion_grid(height_m, background_m, alpha, radius)
    np.testing.assert_array_equal(
        motion_m, motion_by_windows(height_m, background_m, alpha, radius)
    )
    assert alpha > 1 or motion_m.any()
