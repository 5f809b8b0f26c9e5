"""Tracks of the world in the LiDAR frame of a scan."""

import numpy as np

from perception.geometry import se3
from perception.tracking.tracker import covariances_velo


def test_covariances_turn_with_the_axes():
    world = np.diag([4.0, 1.0, 0.4, 0.1])
    to_the_left = se3.from_euler(0, 0, np.pi / 2, np.array([5.0, 6.0, 0.0]))
    turned = covariances_velo(world[None], to_the_left)
    np.testing.assert_allclose(turned[0], np.diag([1.0, 4.0, 0.1, 0.4]), atol=1e-12)
    aslant = covariances_velo(world[None], se3.from_euler(0, 0, 0.3))
    np.testing.assert_allclose(np.linalg.eigvalsh(aslant[0]), [0.1, 0.4, 1, 4])
    assert abs(aslant[0, 0, 1]) > 0.1
