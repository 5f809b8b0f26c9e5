"""The fast map against Algorithm 4 written out, cell for cell where cells fall on cells."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.reference.datmo import ReferenceShortTermMap
from perception.datmo.cell_grid import CellGrid
from perception.datmo.config import THESIS, MotionGridConfig
from perception.datmo.elevation import ElevationGrid
from perception.datmo.short_term_map import ShortTermMap
from perception.errors import UsageError
from perception.geometry.grids import LocalArea
from perception.geometry.se3 import from_euler

CELLS = CellGrid.covering(LocalArea(ahead_m=4.0, behind_m=2.0, side_m=2.4), 0.2)


def queue(scans: int, max_observations: int, min_observations: int) -> MotionGridConfig:
    return replace(
        THESIS,
        scans=scans,
        max_observations=max_observations,
        min_observations=min_observations,
    )


def pose(x_m=0.0, y_m=0.0, yaw_rad=0.0, z_m=0.0):
    return from_euler(0, 0, yaw_rad, np.array([x_m, y_m, z_m]))


def seen(*values):
    """Return a grid whose cell (10, 10) and those ahead of it were seen at such heights."""
    height_m = np.zeros(CELLS.shape, np.float32)
    points = np.zeros(CELLS.shape, np.int64)
    height_m[10 : 10 + len(values), 10] = values
    points[10 : 10 + len(values), 10] = 1
    return ElevationGrid(height_m, points)


def random_grid(rng):
    is_observed = rng.random(CELLS.shape) < 0.6
    height_m = np.where(
        is_observed & (rng.random(CELLS.shape) < 0.5), rng.random(CELLS.shape) * 2, 0
    )
    return ElevationGrid(height_m.astype(np.float32), is_observed.astype(np.int64))


def value_after(heights_m, config, grid=ShortTermMap):
    """Return the map's value of one cell that shows such heights scan after scan; None is unseen."""
    short_term_map = grid(CELLS, config)
    for height_m in heights_m:
        values = [] if height_m is None else [height_m]
        background_m = short_term_map.update(seen(*values), pose())
    return float(background_m[10, 10])


@pytest.mark.parametrize("grid", [ShortTermMap, ReferenceShortTermMap])
@pytest.mark.parametrize(
    ("heights_m", "expected_m"),
    [
        ([1.0, 1.0], 0.0),
        ([1.0, 1.0, 1.0], 1.0),
        ([1.0, None, 1.0, None, 1.0], 1.0),
        ([2.0, 2.0, 1.0, 1.0, 0.0, 0.0], 0.5),  # the last four of six; seen ground counts as 0
        ([2.0, 1.0, 1.0, None, None, None, None], 0.0),  # the first has left the queue of six
        ([2.0, 1.0, 1.0, 1.0, None, None, None], 1.0),
    ],
    ids=["fewer than k", "k", "gaps do not count", "the last m", "expired", "three remain"],
)
def test_a_cell_is_the_mean_of_its_last_observations(grid, heights_m, expected_m):
    config = queue(6, 4, 3)
    assert value_after(heights_m, config, grid) == pytest.approx(expected_m)


@pytest.mark.parametrize("grid", [ShortTermMap, ReferenceShortTermMap])
def test_the_newest_grid_is_in_the_map(grid):
    assert value_after([1.0, 1.0, 2.0], queue(9, 9, 1), grid) == pytest.approx(4 / 3)


def whole_cells(rng):
    """Drive by whole cells: ahead, back, aside, now and then standing."""
    steps = rng.integers((-1, -2), (4, 3), (60, 2))
    steps[20:24] = 0
    return [pose(*place) for place in np.cumsum(steps, axis=0) * CELLS.cell_m]


CONFIG = {
    "m < n": queue(20, 8, 3),
    "m = n": queue(12, 12, 1),
    "m > n": queue(5, 9, 2),
    "short": queue(3, 2, 2),
    "one": queue(1, 1, 1),
}


@pytest.mark.parametrize("config", CONFIG.values(), ids=CONFIG)
def test_both_forms_are_equal_where_the_vehicle_moves_by_whole_cells(config):
    rng = np.random.default_rng(11)
    fast, reference = ShortTermMap(CELLS, config), ReferenceShortTermMap(CELLS, config)
    filled = 0
    for place in whole_cells(rng):
        grid = random_grid(rng)
        expected_m = reference.update(grid, place)
        np.testing.assert_array_equal(fast.update(grid, place), expected_m)
        filled += int((expected_m > 0).sum())
    assert filled > 2000


def test_both_forms_are_equal_far_from_where_the_drive_began():
    rng = np.random.default_rng(2)
    config = queue(10, 5, 2)
    fast, reference = ShortTermMap(CELLS, config), ReferenceShortTermMap(CELLS, config)
    fast.update(random_grid(rng), pose())
    for x_m in np.arange(0, 30_000, 0.2 * 6.0 * 500):  # leaps beyond the window
        fast.update(random_grid(rng), pose(x_m))
    for step in range(15):
        grid, place = random_grid(rng), pose(30_000 + 0.4 * step, 1.0)
        expected_m = reference.update(grid, place)
        if step >= 10:  # the leaps have left the queue
            np.testing.assert_array_equal(fast.update(grid, place), expected_m)
        else:
            fast.update(grid, place)


def wall_grid(world_SE3_velo):
    """Return what a scan sees of walls along the world's axes, every 1.6 m, 0.4 m thick."""
    rows, columns = np.indices(CELLS.shape).reshape(2, -1)
    centers = np.column_stack([CELLS.centers_m(rows, columns), np.zeros(rows.size)])
    places = centers @ world_SE3_velo[:3, :3].T + world_SE3_velo[:3, 3]
    stands = ((places[:, :2] % 1.6) < 0.4).any(axis=1).reshape(CELLS.shape)
    return ElevationGrid(np.where(stands, 1.0, 0.0).astype(np.float32), np.ones(CELLS.shape, int))


@pytest.mark.parametrize("start_yaw_rad", [0.0, 0.7, -2.5])
def test_a_curve_leaves_the_walls_where_they_stand(start_yaw_rad):
    fast = ShortTermMap(CELLS, queue(20, 10, 3))
    reference = ReferenceShortTermMap(CELLS, queue(20, 10, 3))
    for step in range(40):
        yaw_rad = start_yaw_rad + 0.03 * step
        place = pose(0.13 * step, 0.07 * step, yaw_rad, z_m=0.01 * step)
        grid = wall_grid(place)
        background_m, expected_m = fast.update(grid, place), reference.update(grid, place)
    known = expected_m > 0
    assert known.mean() > 0.4
    # Each form rounds to cells on its way: edges blur, by less than half the height nearly everywhere.
    assert np.mean((background_m > 0.5) == (grid.height_m > 0.5)) > 0.85
    assert np.mean((expected_m > 0.5) == (grid.height_m > 0.5)) > 0.85
    assert np.mean(np.abs(background_m - expected_m)[known] < 0.5) > 0.92


def test_motion_counts_in_the_vehicles_own_plane_whatever_the_worlds_axes():
    rng = np.random.default_rng(4)
    level, tilted = (ShortTermMap(CELLS, queue(8, 8, 1)) for _ in range(2))
    other_SE3_world = from_euler(1.2, -0.4, 2.0, np.array([5.0, -3.0, 8.0]))
    for place in whole_cells(rng)[:20]:
        grid = random_grid(rng)
        expected_m = level.update(grid, place)
        np.testing.assert_array_equal(tilted.update(grid, other_SE3_world @ place), expected_m)


def test_a_cleared_map_equals_a_new_one():
    config = queue(6, 6, 1)
    used, fresh = ShortTermMap(CELLS, config), ShortTermMap(CELLS, config)
    rng = np.random.default_rng(7)
    for place in whole_cells(rng)[:10]:
        used.update(random_grid(rng), place)
    used.clear()
    for place in whole_cells(rng)[:10]:
        grid = random_grid(rng)
        np.testing.assert_array_equal(used.update(grid, place), fresh.update(grid, place))


@pytest.mark.parametrize("values", [(5, 3, 4), (2, 9, 3), (5, 5, 0)])
def test_a_queue_that_never_fills_a_cell_is_refused(values):
    with pytest.raises(UsageError) as error:
        queue(*values)
    assert error.value.where == "short-term map"
    assert str(values[2]) in error.value.found
