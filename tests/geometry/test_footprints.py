"""Outlines of things: what they keep, how they turn, and how they are picked."""

import numpy as np
import pytest

from perception.errors import PerceptionError
from perception.geometry import se3
from perception.geometry.footprints import Footprints, footprints_of

SQUARE = [[0, 0, 0.2], [2, 0, 0.4], [2, 2, 1.5], [0, 2, 0.3], [1, 1, 0.9]]
POST = [[5, 5, 0.0], [5, 5.2, 1.0]]
LINE = [[8, 0, 0.5], [9, 0, 0.5], [10, 0, 0.5]]


@pytest.fixture
def clusters() -> Footprints:
    points = np.array(SQUARE + POST + LINE)
    shuffled = np.random.default_rng(0).permutation(len(points))
    cluster_of = np.repeat([0, 1, 2], [5, 2, 3])
    return footprints_of(points[shuffled], cluster_of[shuffled], 3)


def test_footprints_keep_point_count_centroid_and_heights(clusters):
    assert clusters.points.tolist() == [5, 2, 3]
    assert np.allclose(clusters.centroids_m, [[1, 1], [5, 5.1], [9, 0]])
    assert np.allclose(clusters.low_m, [0.2, 0.0, 0.5])
    assert np.allclose(clusters.high_m, [1.5, 1.0, 0.5])


def test_an_outline_leaves_out_what_is_inside(clusters):
    assert clusters.corners[0] == 4


def test_reach_along_a_heading(clusters):
    low, high = clusters.extents_m(np.radians([45.0, 0.0, 90.0]))
    assert np.allclose(high[0] - low[0], 2 * np.sqrt(2))
    assert np.allclose(high[1] - low[1], [0, 0.2])
    # Heading along y: the line reaches over nothing ahead, and 2 m across.
    assert np.allclose(high[2] - low[2], [0, 2])


def test_picking_keeps_each_outline_whole(clusters):
    turned = clusters[np.array([2, 0])]
    low, high = turned.extents_m(np.zeros(2))
    assert np.allclose(high - low, [[2, 0], [2, 2]])
    assert clusters[np.array([False, True, False])].points.tolist() == [2]
    assert len(clusters[np.zeros(3, bool)]) == 0


def test_footprints_move_to_another_frame(clusters):
    moved = clusters.moved(se3.from_euler(0, 0, np.pi / 2, np.array([1.0, 2.0, 3.0])))
    assert np.allclose(moved.centroids_m[2], [1, 11])
    assert np.allclose(moved.high_m, clusters.high_m + 3)
    low, high = moved.extents_m(np.zeros(3))
    assert np.allclose((high - low)[2], [0, 2])


def test_empty_footprints_stay_empty():
    none = Footprints.empty()
    assert len(none) == len(none.moved(np.eye(4))) == 0
    assert none.extents_m(np.zeros(0))[0].shape == (0, 2)
    assert len(footprints_of(np.zeros((0, 3)), np.zeros(0, np.int64), 0)) == 0


def test_columns_of_different_lengths_are_refused():
    with pytest.raises(PerceptionError) as error:
        Footprints(
            np.zeros((3, 2)),
            np.array([4]),
            np.zeros((1, 2)),
            np.zeros(1),
            np.ones(1),
            np.ones(1, int),
        )
    assert error.value.where == "Footprints"
    assert "3 vertices" in error.value.found
