"""Covariances of poses: what a keyframe's rotation does to a pose ahead of it, and how they grow."""

import numpy as np
import pytest
from scipy.stats import chi2

from perception.geometry.se3 import from_euler, rotation_vector
from perception.localization.alignment import Alignment
from perception.localization.odometry import LidarOdometry, PoseOrigin
from perception.localization.pose_covariance import PoseUncertainty
from tests.localization.test_odometry import STEP_S, observed_from, path

EXACT = np.zeros((6, 6))
FIRST = PoseUncertainty.none()


def alignment(covariance):
    return Alignment(np.eye(4), 1.0, 0.0, is_converged=True, covariance=covariance)


def test_a_turn_of_the_keyframe_moves_what_lies_ahead_sideways():
    turn = np.diag([0, 0, 0, 0, 0, 0.01**2])
    ahead = from_euler(0, 0, 0, np.array([10.0, 0, 0]))
    found = PoseUncertainty(turn, EXACT).registered(np.eye(4), alignment(EXACT), ahead).covariance
    np.testing.assert_allclose(np.diagonal(found), [0, 0.1**2, 0, 0, 0, 0.01**2], atol=1e-12)
    assert np.isclose(found[1, 5], 0.1 * 0.01)


def test_the_axes_are_those_of_the_world():
    left = from_euler(0, 0, np.pi / 2)
    along = alignment(np.diag([0, 0, 0, 0.2**2, 0, 0]))
    found = FIRST.registered(left, along, left).covariance
    np.testing.assert_allclose(np.diagonal(found), [0, 0.2**2, 0, 0, 0, 0], atol=1e-12)


def test_a_registered_turn_acts_about_the_keyframe():
    pitch = alignment(np.diag([0, 0.01**2, 0, 0, 0, 0]))
    ahead = from_euler(0, 0, 0, np.array([5.0, 0, 0]))
    found = FIRST.registered(np.eye(4), pitch, ahead).covariance
    np.testing.assert_allclose(np.diagonal(found), [0, 0, 0.05**2, 0, 0.01**2, 0], atol=1e-12)


def test_without_registration_a_pose_is_soon_uncertain():
    pose = from_euler(0, 0, 0, np.array([1.0, 0, 0]))
    found = FIRST.unregistered(np.eye(4), pose, 0.5).covariance
    np.testing.assert_allclose(np.sqrt(np.diagonal(found)), [0.5] * 3 + [0.01] * 3)


def test_what_all_registrations_err_alike_in_grows_with_their_number():
    left = np.diag([0, 0, 0, 0, 0.1**2, 0])
    pose, found = np.eye(4), FIRST
    for _ in range(20):
        step = pose @ from_euler(0, 0, 0, np.array([5.0, 0, 0]))
        found, pose = found.registered(pose, alignment(left), step), step
    # A quarter of the variance is alike.
    assert found.covariance[1, 1] == pytest.approx(0.1**2 * (20 * 0.75 + 20**2 * 0.25))
    # The error is alike along the axes of the vehicle: there and back again, it is none.
    there = FIRST.registered(np.eye(4), alignment(left), np.eye(4))
    turned = from_euler(0, 0, np.pi)
    back = there.registered(turned, alignment(left), turned)
    np.testing.assert_allclose(back.alike, 0, atol=1e-12)


def test_an_unknown_registration_leaves_a_pose_unknown():
    found = FIRST.registered(np.eye(4), alignment(np.full((6, 6), np.nan)), np.eye(4))
    assert np.isnan(found.covariance).all()


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
        errors = found.world_SE3_velo[:3, 3] - pose[:3, 3], turn
        parts = found.covariance[:3, :3], found.covariance[3:, 3:]
        held.extend(
            error @ np.linalg.solve(part, error) <= chi2.ppf(0.9, 3)
            for error, part in zip(errors, parts, strict=True)
        )
    assert 0.8 <= np.mean(held) <= 0.99
