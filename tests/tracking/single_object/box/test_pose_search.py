"""Where a shape fits points, and how sure that is."""

import numpy as np
import pytest

from perception.tracking.single_object.box.object_shape import (
    ObjectShape,
    into_frame,
)
from perception.tracking.single_object.box.observation import ObjectObservation, observation_of
from perception.tracking.single_object.box.pose_search import (
    PoseEstimate,
    search,
    squared_distance,
    support_at,
)
from perception.types import Float64

CAR_M = np.array([4.0, 1.8, 1.5])
SENSOR = np.zeros(2)
SHAPE = ObjectShape.of_box(CAR_M)
WIDE = np.diag([0.4, 0.4, 0.1]) ** 2


def _side_and_rear(pose: Float64) -> Float64:
    """Return points on the right side and the rear of a car at a pose."""
    side = np.column_stack([np.arange(-2, 2.01, 0.1), np.full(41, -0.9)])
    rear = np.column_stack([np.full(19, -2.0), np.linspace(-0.9, 0.9, 19)])
    return _out_of_frame(np.concatenate([side, rear]), pose)


def _out_of_frame(points: Float64, pose: Float64) -> Float64:
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    return np.asarray(points @ np.array([[cos, sin], [-sin, cos]]) + pose[:2])


def _observation(points_xy: Float64) -> ObjectObservation:
    """Return an observation of full cells."""
    points = np.column_stack([points_xy, np.ones(len(points_xy))])
    return observation_of(np.repeat(points, 4, axis=0), SENSOR, 0.1)


def test_finds_a_car_by_two_sides() -> None:
    truth = np.array([10.0, 4.0, 0.1])
    expected = PoseEstimate(truth + np.array([0.35, -0.3, 0.12]), WIDE)
    estimate = search(SHAPE, _observation(_side_and_rear(truth)), (expected,), 40.0)
    np.testing.assert_allclose(estimate.pose, truth, atol=0.08)
    assert squared_distance(estimate, expected) == pytest.approx(2.8, abs=1.0)


def test_a_wall_of_points_does_not_determine_the_position_along_it() -> None:
    truth = np.array([0.0, 6.0, 0.0])
    middle = np.column_stack([np.arange(-0.8, 0.81, 0.1), np.full(17, 5.1)])
    estimate = search(SHAPE, _observation(middle), (PoseEstimate(truth, WIDE),), 17.0)
    along, across = np.sqrt(np.diag(estimate.covariance))[:2]
    assert along > 0.25  # of 0.4 before
    assert across < 0.1


def test_a_denser_neighbour_is_not_taken_for_the_object() -> None:
    truth = np.array([10.0, 4.0, 0.0])
    own = _side_and_rear(truth)[::3]
    neighbour = _side_and_rear(truth + np.array([5.0, 0.0, 0.0]))
    expected = PoseEstimate(truth, np.diag([1.2, 0.2, 0.05]) ** 2)
    observation = _observation(np.concatenate([own, neighbour]))
    shape = SHAPE.with_observation(_observation(own), truth)
    reference = support_at(shape, _observation(own), truth).reward
    estimate = search(shape, observation, (expected,), reference)
    np.testing.assert_allclose(estimate.pose[:2], truth[:2], atol=0.15)


def test_of_two_predicted_poses_takes_the_one_with_the_points() -> None:
    truth = np.array([10.0, 4.0, 0.0])
    moved = PoseEstimate(truth + np.array([0.8, 0.0, 0.0]), np.diag([0.8, 0.1, 0.05]) ** 2)
    stood = PoseEstimate(truth, np.diag([0.05, 0.05, 0.02]) ** 2)
    estimate = search(SHAPE, _observation(_side_and_rear(truth)), (moved, stood), 40.0)
    np.testing.assert_allclose(estimate.pose, truth, atol=0.06)


def test_a_shape_remembers_its_observations() -> None:
    pose = np.array([10.0, 4.0, 0.3])
    mirror = np.array([[0.8, -0.5]])  # deep inside, seen again and again
    observation = _observation(_out_of_frame(mirror, pose))
    shape = SHAPE
    for _ in range(10):
        shape = shape.with_observation(observation, pose)
    assert (
        support_at(shape, observation, pose).reward
        > 1.5 * support_at(SHAPE, observation, pose).reward
    )
    assert shape.scans == 10


def test_points_beside_the_box_are_penalties() -> None:
    pose = np.array([10.0, 4.0, 0.0])
    beside = support_at(SHAPE, _observation(_out_of_frame(np.array([[0.0, 1.3]]), pose)), pose)
    assert beside.reward == 0.0
    assert beside.penalty == pytest.approx(0.7, abs=0.01)
    assert beside.top_m == -np.inf
    far = support_at(SHAPE, _observation(np.array([[20.0, 20.0]])), pose)
    assert far.reward == far.penalty == 0.0


def test_into_frame_undoes_a_pose() -> None:
    points, pose = np.array([[1.0, 0.5], [-2.0, 0.3]]), np.array([5.0, 6.0, 2.0])
    np.testing.assert_allclose(into_frame(_out_of_frame(points, pose), pose), points)
