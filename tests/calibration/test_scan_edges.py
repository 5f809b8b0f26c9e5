"""Edges of a scan: the sides and the top of what is near, and nothing else."""

import numpy as np

from perception.calibration.scan_edges import find_scan_edges
from perception.sensor import HDL_64E
from tests.board_scenes import SIZE_PX, TRUE, Boards


def edges_of(*boards):
    points = Boards(np.array(boards, float).reshape(-1, 5)).scan()
    return find_scan_edges(points, TRUE, SIZE_PX, HDL_64E)


def test_a_board_has_two_sides_and_a_top():
    edges = edges_of((10, -1, 1, -1.5, -0.2))
    sides, top = edges[edges.is_upright].points_velo, edges[~edges.is_upright].points_velo
    # A beam is 3 cm wide there, and beams are 7 cm apart: an edge is known to half of it.
    assert np.abs(np.abs(sides[:, 1]) - 1).max() < 0.03
    assert np.abs(top[:, 2] + 0.2).max() < 0.08
    assert {-1, 1} == set(np.sign(sides[:, 1]))
    assert np.abs(edges.points_velo[:, 0] - 10).max() < 0.1
    assert len(sides) > 20
    assert len(top) > 50


def test_turns_are_counter_clockwise_from_ahead():
    edges = edges_of((10, 3, 5, -1.5, -0.2))
    expected = np.arctan2(edges.points_velo[:, 1], edges.points_velo[:, 0]) / (2 * np.pi)
    np.testing.assert_allclose(edges.turns, expected)
    assert (edges.turns > 0).all()


def test_a_wall_has_none():
    assert len(edges_of()) == 0


def test_the_nearer_of_two_boards_has_the_edge():
    edges = edges_of((10, -1, 1, -1.5, -0.2), (14, -3, 3, -1.5, 0.5))
    beside = edges.points_velo[edges.is_upright & (np.abs(edges.points_velo[:, 1]) < 1.5)]
    assert np.abs(beside[:, 0] - 10).max() < 0.1


def test_a_scan_without_returns_in_view_has_none():
    behind = np.array([[-10, 0, 0, 0.3]], np.float32)
    assert len(find_scan_edges(behind, TRUE, SIZE_PX, HDL_64E)) == 0
