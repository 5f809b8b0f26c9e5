"""Columns over the ground plane, against plain NumPy."""

import cv2
import numpy as np
import pytest

from perception.kernels.columns import count_in_groups, groups_near, joinable_columns
from perception.obstacles.moving_clusters import VoxelColumns
from perception.types import Bool, Float32, Int

CELL_M = 0.25


def places(count: int, seed: int, reach_m: float = 12.0) -> Float32:
    random = np.random.default_rng(seed)
    return random.uniform(-reach_m, reach_m, (count, 3)).astype(np.float32)


def dense_clusters(centers_m: Float32, chosen: Bool, passable: Bool, gap_rad: float) -> Int:
    """Join columns over the whole rectangle around them."""
    x, y = np.floor(centers_m[:, :2].T / CELL_M).astype(np.int64)
    rows, columns = (np.arange(one.min(), one.max() + 1) for one in (x, y))
    of = (x - rows[0]) * len(columns) + y - columns[0]
    reaches = (np.hypot(rows[:, None] + 0.5, columns + 0.5) * gap_rad / 2).astype(np.int64)
    image = chosen.reshape(reaches.shape)
    grown = image.copy()
    for reach in range(1, int(reaches.max()) + 1):
        block = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
        grown |= cv2.dilate((image & (reaches >= reach)).astype(np.uint8), block) > 0
    joined = grown & (chosen | passable).reshape(reaches.shape)
    _, labels = cv2.connectedComponents(joined.astype(np.uint8), connectivity=8)
    return np.asarray(np.where(chosen, labels.ravel(), 0)[of])


@pytest.mark.parametrize("gap_rad", [0.0, 0.015, 0.09])
@pytest.mark.parametrize("weight", [1.0, 0.3])
def test_clusters_are_those_of_the_dense_form(gap_rad: float, weight: float) -> None:
    centers_m = places(900, seed=3) + np.float32([9.0, -4.0, 0.0])
    persisted = np.random.default_rng(4).random(len(centers_m)) < 0.4
    columns = VoxelColumns.over(centers_m)
    size = int(columns.extent[2:].prod())
    static = np.bincount(columns.of, persisted, size)
    chosen = np.bincount(columns.of, ~persisted, size) > static * weight
    found, _ = joinable_columns(columns.of, persisted, columns.extent, weight, gap_rad)
    np.testing.assert_array_equal(found, chosen)
    expected = dense_clusters(centers_m, chosen, static == 0, gap_rad)
    assert expected.max() > 20
    np.testing.assert_array_equal(columns.join(persisted, gap_rad, weight), expected)


def test_occupied_columns_are_joined_with_their_neighbours() -> None:
    centers_m = np.float32([[0.1, 0.1, 0], [0.3, 0.3, 1], [0.9, 0.1, 0], [0.1, 0.1, 2]])
    assert VoxelColumns.over(centers_m).occupied.tolist() == [1, 1, 2, 1]


def test_chosen_places_are_counted_in_their_groups() -> None:
    groups = np.array([0, 2, 2, 1, 2])
    chosen = np.array([True, True, False, False, True])
    assert count_in_groups(groups, chosen, 4).tolist() == [1, 0, 2, 0]


def test_places_are_near_groups_in_their_cell_or_a_neighbour() -> None:
    some, others = places(400, seed=1), places(60, seed=2, reach_m=8.0)
    groups, cell_m = np.arange(60) % 5 + 1, 0.5
    inside, near = groups_near(some, others, groups, cell_m)
    cells, held = (np.floor(one[:, :2] / cell_m).astype(int) for one in (some, others))
    for cell, of_cell, around in zip(cells, inside, near, strict=True):
        away = np.abs(held - cell).max(axis=1)
        assert of_cell in groups[away == 0] or (of_cell == 0 and away.min() > 0)
        assert around == of_cell if of_cell else around in groups[away == 1] or away.min() > 1
    assert 0 < np.count_nonzero(inside) < np.count_nonzero(near) < len(some)
    assert not np.any(groups_near(some, others[:0], groups[:0], cell_m))
    assert len(groups_near(some[:0], others, groups, cell_m)[0]) == 0
