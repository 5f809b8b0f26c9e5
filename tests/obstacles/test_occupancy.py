"""The occupancy grid, on scans that are drawn by hand."""

import numpy as np
import pytest

from perception.errors import UsageError
from perception.geometry import se3
from perception.obstacles.config import OccupancyConfig
from perception.obstacles.occupancy import occupancy_grid
from perception.types import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    Frame,
    Obstacles,
    OccupancyGrid,
    PointState,
    Result,
    Voxels,
)

HEIGHT_M = 2.0
NO_VOXELS = Voxels(np.zeros((0, 3), np.float32), np.zeros(0, np.int64), 0.1)


class FlatGround:
    """The road, 2 m below the LiDAR."""

    def height_m(self, xy_m):
        return np.full(len(xy_m), -HEIGHT_M)

    def distance_m(self, points_velo):
        return points_velo[:, 2] + HEIGHT_M


def rings(*ranges_m: float) -> np.ndarray:
    """Return returns from the road in circles, every fifth of a degree."""
    angles = np.radians(np.arange(0.1, 360, 0.2))
    return np.concatenate(
        [
            np.stack([r * np.cos(angles), r * np.sin(angles), np.full(len(angles), -HEIGHT_M)], 1)
            for r in ranges_m
        ]
    )


def post(x_m: float, y_m: float, *heights_m: float) -> np.ndarray:
    return np.array([[x_m, y_m, height - HEIGHT_M] for height in heights_m])


def result_of(ground, static, moving=(), pose=None, voxels=NO_VOXELS) -> Result:
    parts = [np.reshape(part, (-1, 3)) for part in (ground, static, moving)]
    points = np.concatenate(parts)
    kinds = (PointState.GROUND, PointState.STATIC, PointState.MOVING)
    states = np.repeat(kinds, [len(part) for part in parts]).astype(np.uint8)
    frame = Frame(0, 0.0, np.column_stack([points, np.zeros(len(points))]))
    pose = np.eye(4) if pose is None else pose
    return Result(frame, pose, FlatGround(), Obstacles(states, voxels, NO_VOXELS))


ROAD = rings(4.0, 4.7, 5.5, 6.4, 7.5, 8.8, 10.3)


def at(grid: OccupancyGrid, *xy_m: tuple[float, float]) -> list[int]:
    return grid.states_at(np.array(xy_m)).tolist()


def test_beams_that_pass_low_tell_what_is_free():
    grid = occupancy_grid(result_of(ROAD, post(6.1, 0.1, 0.5, 1.0)))
    assert grid.states.shape == (201, 201)
    assert at(grid, (5.1, 0.1), (6.1, 0.1), (8.1, 0.1)) == [FREE, OCCUPIED, UNKNOWN]
    # The nearest ring is at 4 m: from 3.4 m on its beam is lower than 0.3 m, before it may pass above an obstacle.
    assert at(grid, (0.1, 3.5), (0.1, 3.1)) == [FREE, UNKNOWN]
    assert at(grid, (0.1, 10.2), (0.1, 10.7), (0.1, 30.0)) == [FREE, UNKNOWN, UNKNOWN]


def test_cells_between_rings_that_are_far_apart_are_unknown():
    grid = occupancy_grid(result_of(rings(5.0, 12.0), np.zeros((0, 3))))
    assert at(grid, (4.5, 0.1), (7.1, 0.1), (11.1, 0.1)) == [FREE, UNKNOWN, FREE]


def test_the_cells_around_an_obstacle_are_not_free():
    grid = occupancy_grid(result_of(ROAD, post(6.1, 0.1, 0.5)))
    beside = [(5.9, 0.1), (6.1, 0.3), (6.1, -0.1)]
    assert at(grid, *beside) == 3 * [UNKNOWN]


def test_a_kerb_is_neither_free_nor_occupied():
    grid = occupancy_grid(result_of(ROAD, post(6.1, 0.1, 0.15)))
    assert at(grid, (6.1, 0.1)) == [UNKNOWN]


def test_what_moves_may_be_left_out():
    scan = result_of(ROAD, np.zeros((0, 3)), moving=post(6.1, 0.1, 0.5))
    assert at(occupancy_grid(scan), (6.1, 0.1), (5.1, 0.1)) == [OCCUPIED, FREE]
    without = occupancy_grid(scan, with_moving=False)
    assert at(without, (5.3, 0.1), (8.1, 0.1)) == [FREE, UNKNOWN]
    assert (without.states == OCCUPIED).sum() == 0


def test_static_voxels_of_earlier_scans_are_occupied_where_nothing_is_seen_now():
    voxels = Voxels(
        np.array([[14.1, 0.1, -1], [5.1, 0.1, -1]], np.float32), np.ones(2, np.int64), 0.1
    )
    grid = occupancy_grid(result_of(ROAD, np.zeros((0, 3)), voxels=voxels))
    assert at(grid, (14.1, 0.1), (5.1, 0.1)) == [OCCUPIED, FREE]


def test_cells_keep_their_places_in_the_world():
    pose = se3.from_euler(0, 0, np.pi / 2, np.array([100.07, 50.03, 3.0]))
    grid = occupancy_grid(result_of(ROAD, post(6.1, 0.1, 0.5), pose=pose))
    assert grid.origin_m == pytest.approx([80.0, 30.0, 1.0])
    assert at(grid, (99.97, 56.13), (99.97, 55.13)) == [OCCUPIED, FREE]
    small = occupancy_grid(result_of(ROAD, post(6.1, 0.1, 0.5)), OccupancyConfig(5.0, 0.5))
    assert small.states.shape == (21, 21)


def test_no_cell_is_free_in_a_scan_without_ground():
    grid = occupancy_grid(result_of(np.zeros((0, 3)), post(6.1, 0.1, 0.5)))
    assert (grid.states == FREE).sum() == 0
    assert np.isfinite(grid.origin_m).all()


@pytest.mark.parametrize(
    "wrong", [{"cell_m": 0.0}, {"cell_m": 0.01}, {"cell_m": 30.0}, {"rate_hz": 0.0}]
)
def test_a_grid_without_cells_or_with_too_many_is_one_sentence(wrong: dict[str, float]):
    with pytest.raises(
        UsageError, match="occupancy grid: expected positive values, and a reach of 1 to 1000 cells"
    ):
        OccupancyConfig(**wrong)
