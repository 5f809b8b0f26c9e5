from dataclasses import dataclass

import numpy as np
import pytest

from perception.geometry.grids import LocalArea
from perception.geometry.se3 import from_euler
from perception.localization.scan_window import PosedScan, ScanWindow
from perception.obstacles.motion_counters import (
    CounterSegmenter,
    classify_columns,
    column_counter,
    log_ratio,
    subtract,
)
from perception.obstacles.voxels import KeyCounts, VoxelGrid
from perception.types import PointState
from tests.reference.voxels import (
    count_columns_by_loop,
    log_ratio_by_loop,
    masks_by_loop,
    subtract_dense,
)


@dataclass(frozen=True)
class FlatGround:
    z_m: float = 0.0

    def height_m(self, xy_m):
        return np.full(len(xy_m), self.z_m)

    def distance_m(self, points_velo):
        return points_velo[:, 2] - self.z_m


def block(x, y, z=0.5, points=60, size=0.09):
    """Points that fill one voxel whose corner is at (x, y, z)."""
    steps = np.linspace(0.005, size, points)[:, None]
    return np.hstack([np.array([[x, y, z]]) + steps, np.zeros((points, 1))]).astype(np.float32)


def test_subtraction_keeps_what_several_scans_saw():
    # Voxel 5 stands; 1, 2, 3 is one thing that moves.
    scans = [np.array([5, 5, 1]), np.array([5, 2, 2]), np.array([5, 5, 5, 3])]
    voxels = subtract(scans)
    assert (voxels.merged.keys.tolist(), voxels.merged.counts.tolist()) == (
        [1, 2, 3, 5],
        [1, 2, 1, 6],
    )
    assert (voxels.static.keys.tolist(), voxels.static.counts.tolist()) == ([5], [6])
    assert (voxels.moving.keys.tolist(), voxels.moving.counts.tolist()) == ([3], [1])


def test_one_scan_alone_has_no_static_voxel():
    voxels = subtract([np.array([4, 4, 9])])
    assert len(voxels.static.keys) == 0
    assert voxels.moving.keys.tolist() == [4, 9]


@pytest.mark.parametrize("seed", range(3))
def test_equals_the_reference(seed):
    rng = np.random.default_rng(seed)
    grid = VoxelGrid(np.zeros(3), (6, 5, 4), 0.1)
    scans = [rng.integers(0, 120, 90) for _ in range(4)]
    dense = [np.bincount(keys, minlength=120).reshape(6, 5, 4) for keys in scans]
    plain_static, plain_moving = subtract_dense(sum(dense), dense)
    voxels = subtract(scans)
    static, moving = column_counter(grid, voxels.static), column_counter(grid, voxels.moving)
    assert static.tolist() == count_columns_by_loop(plain_static).tolist()
    assert moving.tolist() == count_columns_by_loop(plain_moving).tolist()
    np.testing.assert_allclose(log_ratio(moving, static), log_ratio_by_loop(moving, static))
    masks = classify_columns(static, moving, 10, 2)
    plain_is_static, plain_is_moving = masks_by_loop(static, moving, 10, 2)
    assert masks.is_static.tolist() == plain_is_static.tolist()
    assert masks.is_moving.tolist() == plain_is_moving.tolist()


def test_counters_sum_over_height():
    grid = VoxelGrid(np.zeros(3), (2, 1, 3), 0.1)
    voxels = KeyCounts(np.array([0, 2, 4]), np.array([10, 5, 7]))
    assert column_counter(grid, voxels).tolist() == [[15], [7]]


@pytest.mark.parametrize(
    ("static", "moving", "is_static", "is_moving"),
    [
        (49, 0, False, False),  # too few points to be static
        (50, 0, True, False),
        (0, 4, False, False),  # too few points to move
        (0, 5, False, True),
        (4, 5, False, True),  # a rival below the floor counts as one point
        (60, 4, True, False),
        (5, 5, False, False),  # a tie is neither
        (60, 70, False, True),  # the larger counter wins
        (70, 60, True, False),
    ],
)
def test_masks_with_the_thesis_thresholds(static, moving, is_static, is_moving):
    masks = classify_columns(np.array([[static]]), np.array([[moving]]), 50, 5)
    assert masks.is_static.tolist() == [[is_static]]
    assert masks.is_moving.tolist() == [[is_moving]]


def test_log_ratio_is_negative_where_static():
    ratio = log_ratio(np.array([[0, 20, 10]]), np.array([[100, 0, 10]]))
    np.testing.assert_allclose(ratio, [[-np.log(100), np.log(20), 0]])


def window_of(*scans, step_m=0.0):
    """Scans given in the world's axes, from a vehicle that drives along x."""
    window = ScanWindow(len(scans) - 1)
    for number, points in enumerate(scans):
        pose = from_euler(0, 0, 0, np.array([number * step_m, 0, 0]))
        local = points.copy()
        local[:, 0] -= np.float32(number * step_m)
        window.push(PosedScan(local, pose))
    return window


def test_a_standing_block_is_static_and_a_walking_one_moves():
    stands = block(5.0, 2.0)
    scans = [np.vstack([stands, block(4.0 + 0.2 * k, -2.0)]) for k in range(4)]
    segmented = CounterSegmenter(LocalArea()).update(window_of(*scans), FlatGround())
    assert set(segmented.point_states[:60]) == {PointState.STATIC}
    assert set(segmented.point_states[60:]) == {PointState.MOVING}
    np.testing.assert_allclose(segmented.static.centers_m, [[5.05, 2.05, 0.55]], atol=1e-5)
    assert segmented.static.counts.tolist() == [240]
    np.testing.assert_allclose(segmented.moving.centers_m, [[4.65, -1.95, 0.55]], atol=1e-5)
    assert segmented.moving.counts.tolist() == [60]


def test_the_vehicle_s_own_way_is_taken_out():
    stands = block(5.0, 2.0)
    segmented = CounterSegmenter(LocalArea()).update(
        window_of(stands, stands, stands, step_m=0.5), FlatGround()
    )
    assert set(segmented.point_states) == {PointState.STATIC}
    assert len(segmented.moving) == 0


def test_ground_and_outside_are_different_states():
    points = np.array([[3, 0, 0.1, 0], [3, 0, -0.4, 0], [3, 0, 2.5, 0], [40, 0, 1, 0]], np.float32)
    states = CounterSegmenter(LocalArea()).update(window_of(points), FlatGround()).point_states
    assert states.tolist() == [
        PointState.GROUND,
        PointState.GROUND,
        PointState.OUTSIDE,
        PointState.OUTSIDE,
    ]


def test_counters_show_the_steps_of_figure_5_6():
    stands = block(5.0, 2.0)
    scans = [np.vstack([stands, block(4.0 + 0.2 * k, -2.0)]) for k in range(4)]
    segmenter = CounterSegmenter(LocalArea())
    counters = segmenter.counters(segmenter.voxelize(window_of(*scans), FlatGround()))
    assert counters.static_before.sum() == 480
    assert counters.static.sum() == 240
    assert counters.moving.sum() == 60
    assert counters.masks.is_static.sum() == counters.masks.is_moving.sum() == 1
    assert counters.log_ratio.max() == pytest.approx(np.log(60))
    assert counters.log_ratio.min() == pytest.approx(-np.log(240))
