"""Covariances of poses: what a keyframe's rotation does to a pose ahead of it, and how they grow."""

import numpy as np
from scipy.stats import chi2

from perception.geometry.se3 import from_euler, rotation_vector
from perception.localization.located_scan import PoseOrigin
from perception.localization.odometry import LidarOdometry
from perception.localization.pose_covariance import (
    plane_covariances_m2,
    plane_deviations_m,
    registered_covariance,
    unregistered_covariance,
)
from tests.localization.test_odometry import STEP_S, observed_from, path

EXACT = np.zeros((6, 6))


def test_a_turn_of_the_keyframe_moves_what_lies_ahead_sideways():
    turn = np.diag([0, 0, 0, 0, 0, 0.01**2])
    ahead = from_euler(0, 0, 0, np.array([10.0, 0, 0]))
    found = registered_covariance(turn, np.eye(4), EXACT, ahead)
    np.testing.assert_allclose(np.diagonal(found), [0, 0.1**2, 0, 0, 0, 0.01**2], atol=1e-12)
    assert np.isclose(found[1, 5], 0.1 * 0.01)


def test_the_axes_are_those_of_the_world():
    left = from_euler(0, 0, np.pi / 2)
    along = np.diag([0, 0, 0, 0.2**2, 0, 0])
    found = registered_covariance(EXACT, left, along, left)
    np.testing.assert_allclose(np.diagonal(found), [0, 0.2**2, 0, 0, 0, 0], atol=1e-12)


def test_a_registered_turn_acts_about_the_keyframe():
    pitch = np.diag([0, 0.01**2, 0, 0, 0, 0])
    ahead = from_euler(0, 0, 0, np.array([5.0, 0, 0]))
    found = registered_covariance(EXACT, np.eye(4), pitch, ahead)
    np.testing.assert_allclose(np.diagonal(found), [0, 0, 0.05**2, 0, 0.01**2, 0], atol=1e-12)


def test_without_registration_a_pose_is_soon_uncertain():
    pose = from_euler(0, 0, 0, np.array([1.0, 0, 0]))
    found = unregistered_covariance(EXACT, np.eye(4), pose, 0.5)
    np.testing.assert_allclose(np.sqrt(np.diagonal(found)), [0.5] * 3 + [0.01] * 3)
    unknown = unregistered_covariance(EXACT, np.eye(4), pose, 0.5, has_motion=False)
    np.testing.assert_allclose(np.sqrt(np.diagonal(unknown)), [7.5] * 3 + [0.175] * 3)


def test_a_turn_moves_places_sideways_by_their_distance():
    covariance = np.diag([0.01, 0.04, 9.0, 9.0, 9.0, 0.02**2])
    found = plane_covariances_m2(covariance, np.array([[0.0, 0.0, 1.0], [10.0, 0.0, 0.0]]))
    np.testing.assert_allclose(found[0], [[0.01, 0.0], [0.0, 0.04]])
    np.testing.assert_allclose(found[1], [[0.01, 0.0], [0.0, 0.04 + 0.2**2]])
    covariance[1, 5] = covariance[5, 1] = 0.1 * 0.02
    of_place = plane_covariances_m2(covariance, np.array([[10.0, 0.0]]))
    deviations_m = plane_deviations_m(covariance, np.array([0.0, 10.0]))
    np.testing.assert_allclose(deviations_m**2, [0.05, np.trace(of_place[0])])


def test_an_unknown_registration_leaves_a_pose_unknown():
    found = registered_covariance(EXACT, np.eye(4), np.full((6, 6), np.nan), np.eye(4))
    assert np.isnan(found).all()


def test_poses_become_less_certain_from_keyframe_to_keyframe():
    odometry = LidarOdometry()
    found = [
        odometry.update(observed_from(pose, index), index * STEP_S)
        for index, pose in enumerate(path(12, speed_m_s=10.0, turn_rad_s=0.0))
    ]
    assert found[-1].origin is PoseOrigin.REGISTERED
    np.testing.assert_array_equal(found[0].covariance, 0)
    deviations_m = np.sqrt([np.diagonal(one.covariance)[:3] for one in found])
    # A single registration is more or less certain by chance.
    assert (deviations_m[6:].mean(axis=0) > deviations_m[1:6].mean(axis=0)).all()
    assert (deviations_m[-1] < 0.1).all()
    for one in found:
        assert (np.linalg.eigvalsh(one.covariance) > -1e-12).all()


def test_intervals_of_a_step_hold_what_they_say():
    held = []
    for seed in range(0, 60, 2):
        odometry = LidarOdometry()
        start, pose = path(2, speed_m_s=10.0, turn_rad_s=0.1)
        odometry.update(observed_from(start, seed), 0.0)
        found = odometry.update(observed_from(pose, seed + 1), STEP_S)
        turn = rotation_vector(found.world_SE3_velo[:3, :3] @ pose[:3, :3].T)
        error = np.concatenate([found.world_SE3_velo[:3, 3] - pose[:3, 3], turn])
        held.append(error @ np.linalg.solve(found.covariance, error) <= chi2.ppf(0.9, 6))
    assert 0.8 <= np.mean(held) <= 0.99
