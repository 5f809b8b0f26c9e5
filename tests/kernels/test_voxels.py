"""Compiled functions of voxels, beside NumPy and a dictionary."""

import numpy as np
import pytest

from perception.geometry.se3 import from_euler, transform_points
from perception.kernels.voxels import merge_voxels, moved_centers, remembered_voxels
from perception.obstacles.voxels import VoxelGrid


def test_groups_of_moved_points_equal_those_of_the_moved() -> None:
    grid = VoxelGrid(np.array([-4.0, -6, -1]), (80, 120, 30), 0.1)
    motion = from_euler(0.1, -0.2, 1.0, np.array([0.5, 0.3, -0.2]))
    points = np.random.default_rng(0).normal(0, 3, (3000, 3)).astype(np.float32)
    keys, first, group_of, counts = np.unique(
        grid.keys(transform_points(motion, points.astype(np.float64))),
        return_index=True,
        return_inverse=True,
        return_counts=True,
    )
    groups = grid.groups_of_moved(points, motion)
    np.testing.assert_array_equal(groups.counted.keys, keys)
    np.testing.assert_array_equal(groups.counted.counts, counts)
    np.testing.assert_array_equal(groups.first, first)
    np.testing.assert_array_equal(groups.group_of, group_of)
    assert counts.max() > 1 and len(keys) > 1000
    assert len(grid.groups_of_moved(points[:0], motion).group_of) == 0


def drawn(seed: int, size: int) -> tuple[np.ndarray, ...]:
    random = np.random.default_rng(seed)
    keys = np.sort(random.choice(60, size, replace=False))
    counts, centers = random.integers(1, 9, size), random.normal(0, 1, (size, 3))
    return keys, counts, random.integers(0, 5, size), centers.astype(np.float32)


@pytest.mark.parametrize(("old", "new"), [(0, 0), (0, 7), (7, 0), (40, 30)])
def test_merged_voxels_equal_a_dictionary(old: int, new: int) -> None:
    keys, counts, ages, centers = drawn(0, old)
    new_keys, new_counts, _, new_centers = drawn(1, new)
    stays = np.random.default_rng(2).random(old) < 0.6
    expected = {}
    for row in np.flatnonzero(stays):
        expected[keys[row]] = [counts[row], ages[row] + 1, centers[row]]
    for key, count, center in zip(new_keys, new_counts, new_centers, strict=True):
        known = expected.get(key, [0, 0, center])
        expected[key] = [known[0] + count, 0, known[2]]
    merged = merge_voxels(keys, counts, ages, centers, stays, new_keys, new_counts, new_centers)
    assert merged[0].tolist() == sorted(expected)
    for row, key in enumerate(merged[0]):
        assert (merged[1][row], merged[2][row]) == tuple(expected[key][:2])
        np.testing.assert_array_equal(merged[3][row], expected[key][2])


def test_centres_after_a_motion():
    corner_m, shape, size_m = np.array([-5.0, -4.0, -1.0]), (100, 80, 30), 0.1
    random = np.random.default_rng(0)
    cells = random.integers(0, shape, (50, 3))
    keys = (cells[:, 0] * shape[1] + cells[:, 1]) * shape[2] + cells[:, 2]
    pose = from_euler(0.02, -0.03, 0.7, np.array([3.0, -2.0, 0.5]))
    centers = moved_centers(keys, shape, corner_m, size_m, pose)
    expected = (corner_m + (cells + 0.5) * size_m) @ pose[:3, :3].T + pose[:3, 3]
    np.testing.assert_allclose(centers, expected, atol=1e-5)


def test_voxels_that_stay_in_the_memory():
    random = np.random.default_rng(1)
    keys = np.unique(random.integers(0, 400, 150))
    ages, centers = random.integers(0, 5, len(keys)), random.normal(0, 6, (len(keys), 3))
    seen, moving = (np.unique(random.integers(0, 400, size)) for size in (80, 40))
    centers = centers.astype(np.float32)
    stays, unseen = remembered_voxels(keys, ages, centers, seen, moving, (-5, 9, -4, 4), 3)
    x, y, _ = centers.T
    is_inside = (x > -5) & (x < 9) & (np.abs(y) < 4)
    is_observed = np.isin(keys, seen)
    expected = (is_observed | (ages < 3)) & is_inside & ~np.isin(keys, moving)
    assert 10 < expected.sum() < len(keys) - 10
    np.testing.assert_array_equal(stays, expected)
    np.testing.assert_array_equal(unseen, np.flatnonzero(expected & ~is_observed))
