"""Rotations beside SciPy's."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from perception.geometry.se3 import (
    from_euler,
    from_rotation_vector,
    interpolate,
    rotation_vector,
)


def test_rotations_by_roll_pitch_and_yaw_equal_those_of_scipy():
    for roll, pitch, yaw in np.random.default_rng(5).uniform(-3, 3, (50, 3)):
        expected = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
        np.testing.assert_allclose(from_euler(roll, pitch, yaw)[:3, :3], expected, atol=1e-14)


@pytest.mark.parametrize("angle_rad", [0.0, 1e-12, 1e-6, 0.01, 1.0, 3.1])
def test_rotation_vectors_equal_those_of_scipy(angle_rad):
    for axis in np.random.default_rng(6).normal(size=(20, 3)):
        vector = angle_rad * axis / np.linalg.norm(axis)
        rotation = Rotation.from_rotvec(vector).as_matrix()
        np.testing.assert_allclose(from_rotation_vector(vector), rotation, atol=1e-14)
        np.testing.assert_allclose(rotation_vector(rotation), vector, atol=1e-13)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_interpolated_rotations_equal_those_of_scipy(share):
    before, after = from_euler(0.1, -0.2, 3.0, np.zeros(3)), from_euler(-0.3, 0.4, -2.0, np.ones(3))
    rotations = Rotation.from_matrix(np.stack([before[:3, :3], after[:3, :3]]))
    expected = Slerp([0.0, 1.0], rotations)(share).as_matrix()
    found = interpolate(before, after, share)
    np.testing.assert_allclose(found[:3, :3], expected, atol=1e-14)
    np.testing.assert_allclose(found[:3, 3], share, atol=1e-15)
