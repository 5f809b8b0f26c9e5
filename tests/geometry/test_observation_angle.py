import numpy as np
import pytest

from perception.geometry.boxes import (
    observation_angles_rad,
    usual_observation_angles_rad,
)
from perception.types import Boxes3D, Calibration

CAMERA = Calibration(
    image_P_cam=np.array([[700.0, 0, 600, 0], [0, 700, 180, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0, -1, 0, 0.0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]),
)


@pytest.mark.parametrize(
    ("x_m", "y_m", "yaw_rad", "expected"),
    [
        (20, 0, 0, -np.pi / 2),  # ahead, seen from behind
        (20, 0, np.pi, np.pi / 2),  # ahead, it comes
        (20, 20, np.pi / 4, -np.pi / 2),  # to the left, it drives away along the ray
        (20, -20, np.pi / 4, -np.pi),  # to the right, across the ray to the left
        (20, 0, np.nan, np.nan),
    ],
)
def test_angle_is_relative_to_the_ray(x_m, y_m, yaw_rad, expected):
    box = Boxes3D(np.array([[x_m, y_m, -1.7]]), np.ones((1, 3)), np.array([yaw_rad]))
    found = observation_angles_rad(box)[0]
    assert np.cos(found) == pytest.approx(np.cos(expected), abs=1e-9, nan_ok=True)
    assert np.sin(found) == pytest.approx(np.sin(expected), abs=1e-9, nan_ok=True)


def test_the_usual_heading_is_that_of_the_camera():
    boxes_px = np.array([[550.0, 150, 650, 200], [1200, 150, 1400, 200]])
    found = usual_observation_angles_rad(boxes_px, CAMERA)
    # The same as of boxes at these columns that head as the camera does.
    boxes = Boxes3D(np.array([[20.0, 0, -1.7], [20, -20, -1.7]]), np.ones((2, 3)), np.zeros(2))
    np.testing.assert_allclose(found, observation_angles_rad(boxes), atol=1e-12)
