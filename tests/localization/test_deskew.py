"""Sweeps moved to one time, against points whose motion is known exactly."""

import numpy as np
import pytest

from perception.errors import PerceptionError
from perception.geometry.se3 import from_euler, inverse
from perception.localization.deskew import SweepMotion, deskew

PERIOD_S = 0.1
# 15 m/s ahead while turning by 0.6 rad/s and nodding by 0.1 rad/s.
SPEED_M_S, YAW_RAD_S, PITCH_RAD_S = 15.0, 0.6, 0.1


def exact_pose(time_s: float) -> np.ndarray:
    """Return world_SE3_velo by small steps of the constant motion along the vehicle's own axes."""
    pose = np.eye(4)
    steps = 2000
    step_s = time_s / steps
    step = from_euler(
        0, PITCH_RAD_S * step_s, YAW_RAD_S * step_s, np.array([SPEED_M_S * step_s, 0, 0])
    )
    for _ in range(steps):
        pose = pose @ step
    return pose


@pytest.fixture(scope="module")
def sweep() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (N, 4) points at the stamp, the same as measured, and their times."""
    rng = np.random.default_rng(3)
    points = rng.uniform([-60, -60, -2, 0], [60, 60, 4, 1], (60, 4))
    times_s = rng.uniform(-PERIOD_S / 2, PERIOD_S / 2, 60)
    measured = points.copy()
    for row, time_s in enumerate(times_s):
        measured[row, :3] = (inverse(exact_pose(time_s)) @ [*points[row, :3], 1.0])[:3]
    return points.astype(np.float32), measured.astype(np.float32), times_s.astype(np.float32)


def test_steady_motion_is_undone_to_a_tenth_of_a_millimetre(
    sweep: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    points, measured, times_s = sweep
    motion = SweepMotion.steady(exact_pose(PERIOD_S), PERIOD_S, (-0.05, 0.05))
    error_m = np.linalg.norm(deskew(measured, times_s, motion)[:, :3] - points[:, :3], axis=1)
    assert np.linalg.norm((measured - points)[:, :3], axis=1).max() > 1.0
    assert error_m.max() < 3e-4
    assert np.array_equal(deskew(measured, times_s, motion)[:, 3], points[:, 3])


def test_motion_from_the_past_is_that_from_the_future(
    sweep: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    points, measured, times_s = sweep
    motion = SweepMotion.steady(exact_pose(-PERIOD_S), -PERIOD_S, (-0.05, 0.05))
    assert np.abs(deskew(measured, times_s, motion) - points).max() < 3e-4


def test_points_without_a_return_and_a_standing_vehicle_stay() -> None:
    points = np.array([[0, 0, 0, 0], [5, 1, 0, 0.5]], np.float32)
    motion = SweepMotion.steady(exact_pose(0.1), 0.1, (0.0, 0.1))
    moved = deskew(points, np.array([0.1, 0.0], np.float32), motion)
    assert np.array_equal(moved, points)
    still = SweepMotion.steady(np.eye(4), 0.1, (0.0, 0.1))
    assert np.array_equal(deskew(points, np.array([0.1, 0.1], np.float32), still), points)


def test_times_beyond_the_motion_move_as_its_ends() -> None:
    points = np.array([[5, 1, 0, 0.5]] * 2, np.float32)
    motion = SweepMotion.steady(exact_pose(0.1), 0.1, (0.0, 0.1))
    ends = deskew(points, np.array([0.0, 0.1], np.float32), motion)
    assert np.array_equal(deskew(points, np.array([-1.0, 9.0], np.float32), motion), ends)


def test_one_time_a_point_is_expected() -> None:
    motion = SweepMotion.steady(np.eye(4), 0.1, (0.0, 0.1))
    with pytest.raises(PerceptionError, match=r"point_times_s: expected shape \(2\)"):
        deskew(np.ones((2, 4), np.float32), np.zeros(3, np.float32), motion)
