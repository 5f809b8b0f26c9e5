"""Score of an offset, its gradient, and the offset with the best score."""

import numpy as np
import pytest

from perception.calibration.edge_alignment import STEP, EdgeAlignment
from perception.calibration.frame_edges import FrameEdges, SweepTurn, steady_motion
from perception.geometry.se3 import from_motion_vector, from_rotation_translation
from perception.sensor import HDL_64E


@pytest.fixture(scope="module")
def alignment(board_frames):
    return EdgeAlignment([FrameEdges.of(frame, HDL_64E) for frame in board_frames])


def test_the_true_calibration_scores_best(alignment):
    here = alignment.score(np.zeros(6), 2.0).value
    for axis in range(6):
        for sign in (-1, 1):
            assert alignment.score(2 * sign * STEP[axis] * np.eye(6)[axis], 2.0).value < here


def test_the_gradient_is_that_of_the_value(alignment):
    offset = 0.3 * STEP * np.array([1, -1, 1, 1, -1, 1])
    found = alignment.score(offset, 4.0).gradient * STEP
    for axis in range(3, 6):  # translations add up; rotations are composed
        step = 1e-3 * STEP * np.eye(6)[axis]
        ahead, behind = (alignment.score(offset + sign * step, 4.0).value for sign in (1, -1))
        assert found[axis] == pytest.approx((ahead - behind) / 2e-3, rel=0.03, abs=2e-5)


def test_the_gradient_of_rotations_is_that_of_the_value(alignment):
    found = alignment.score(np.zeros(6), 4.0).gradient * STEP
    for axis in range(3):
        step = 1e-3 * STEP * np.eye(6)[axis]
        ahead, behind = (alignment.score(sign * step, 4.0).value for sign in (1, -1))
        assert found[axis] == pytest.approx((ahead - behind) / 2e-3, rel=0.03, abs=2e-5)


def test_frames_add_up_to_the_whole(alignment):
    score = alignment.score(0.2 * STEP, 4.0)
    np.testing.assert_allclose(score.frame_gradients.sum(axis=0) / alignment.edges, score.gradient)


def test_edges_move_with_the_sweep(board_frames):
    later = from_rotation_translation(np.eye(3), np.array([1.0, 0, 0]))
    motion = steady_motion(later, 0.1, HDL_64E)
    edges = FrameEdges.of(board_frames[0], HDL_64E, motion)
    still = edges.points_cam(SweepTurn.NONE)
    for turn in (SweepTurn.CLOCKWISE, SweepTurn.COUNTER_CLOCKWISE):
        moved = edges.points_cam(turn) - still
        np.testing.assert_allclose(moved[:, 2], turn * edges.scan.turns, atol=1e-4)
        np.testing.assert_allclose(moved[:, :2], 0, atol=1e-4)


def test_an_offset_is_a_rotation_and_a_translation():
    moved = from_motion_vector(np.array([0, 0, np.pi / 2, 1.0, 2.0, 3.0]))
    np.testing.assert_allclose(moved[:3], [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3]], atol=1e-12)
