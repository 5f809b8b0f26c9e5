import numpy as np
import pytest

from benchmarks.reference.voxels import count_voxels_by_unique_rows
from perception.errors import UsageError
from perception.obstacles.voxels import VoxelGrid, count_keys, count_voxels
from tests.reference.voxels import count_voxels_by_loop


def test_counts_by_hand():
    points = np.array([[0.01, 0.01, 0.01], [0.09, 0.02, 0.03], [0.15, 0, 0], [-0.01, 0, 0]])
    voxels = count_voxels(points, 0.1)
    np.testing.assert_allclose(
        voxels.centers_m, [[-0.05, 0.05, 0.05], [0.05, 0.05, 0.05], [0.15, 0.05, 0.05]], atol=1e-6
    )
    assert voxels.counts.tolist() == [1, 2, 1]


@pytest.mark.parametrize("reference", [count_voxels_by_loop, count_voxels_by_unique_rows])
def test_equals_both_references(reference):
    points = np.random.default_rng(3).normal(0, 0.4, (500, 3)).astype(np.float32)
    fast, slow = count_voxels(points, 0.1), reference(points, 0.1)
    np.testing.assert_allclose(fast.centers_m, slow.centers_m, atol=1e-5)
    assert fast.counts.tolist() == slow.counts.tolist()


def test_every_point_is_counted_once():
    points = np.random.default_rng(4).uniform(-30, 30, (5000, 4)).astype(np.float32)
    assert count_voxels(points, 0.1).counts.sum() == 5000


def test_no_points_give_no_voxels():
    voxels = count_voxels(np.zeros((0, 3)), 0.1)
    assert len(voxels) == 0
    assert voxels.centers_m.shape == (0, 3)


def test_a_cell_knows_its_column_and_its_center():
    grid = VoxelGrid(np.array([-1.0, 0.0, 0.0]), (4, 3, 2), 0.5)
    keys = grid.keys(np.array([[-0.9, 0.1, 0.1], [0.9, 1.4, 0.9]]))
    assert keys.tolist() == [0, 23]
    assert grid.columns(keys).tolist() == [0, 11]
    np.testing.assert_allclose(grid.centers_m(keys), [[-0.75, 0.25, 0.25], [0.75, 1.25, 0.75]])


def test_keys_of_a_wide_grid_do_not_overflow():
    points = np.array([[-4000.0, -4000, -50], [4000, 4000, 50]])
    voxels = count_voxels(points, 0.1)
    np.testing.assert_allclose(voxels.centers_m, points + 0.05, atol=1e-3)


def test_points_beyond_a_grid_go_to_its_border():
    grid = VoxelGrid(np.zeros(3), (2, 2, 2), 1.0)
    assert grid.keys(np.array([[-5.0, -5, -5], [9, 9, 9]])).tolist() == [0, 7]


def test_equal_keys_are_counted():
    counted = count_keys(np.array([7, 3, 7, 7]))
    assert counted.keys.tolist() == [3, 7]
    assert counted.counts.tolist() == [1, 3]


def test_a_voxel_without_extent_is_refused():
    with pytest.raises(UsageError) as error:
        count_voxels(np.zeros((1, 3)), 0.0)
    assert (error.value.where, error.value.found) == ("voxel size_m", "0.0")
