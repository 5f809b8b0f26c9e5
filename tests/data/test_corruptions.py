"""Disturbed frames, by what light, rays and projections come to."""

from dataclasses import replace

import numpy as np
import pytest

from data.corruptions import (
    darken,
    drop_points,
    rotate_calibration,
    sensor_corruptions,
    shift_calibration,
)
from perception.errors import CalibrationError, UsageError
from perception.evaluation.detection.config import CorruptionLevels
from perception.geometry.camera import project
from perception.types import Frame
from tests.car_frames import CALIBRATION, SIZE_PX
from tests.faults import fault


@pytest.fixture
def frame():
    rng = np.random.default_rng(0)
    points = rng.uniform((5, -3, -1, 0), (30, 3, 1, 1), (1000, 4)).astype(np.float32)
    image = np.full((SIZE_PX[1], SIZE_PX[0], 3), 200, np.uint8)
    return Frame(0, 0.0, points, image, calibration=CALIBRATION)


def rng():
    return np.random.default_rng(7)


def pixels(frame):
    return project(frame.calibration.image_P_velo, frame.points_velo)[0]


@pytest.mark.parametrize("stops", [1, 2, 4])
def test_each_stop_halves_the_light(frame, stops):
    dark = darken(frame, stops, rng())
    light = (dark.image / 255.0) ** 2.2
    expected = (200 / 255) ** 2.2 / 2**stops
    assert light.mean() == pytest.approx(expected, rel=0.01)
    # Noise in electrons: the root of their number, and that of reading them.
    electrons = 10_000 * expected
    noise = np.sqrt(electrons + 25) / 10_000
    rounding = 2.2 * expected / (255 * expected ** (1 / 2.2)) / np.sqrt(12)
    assert light.std() == pytest.approx(np.hypot(noise, rounding), rel=0.1)


def test_zero_darkness_leaves_the_image(frame):
    assert darken(frame, 0, rng()) is frame
    blind = replace(frame, image=None)
    assert darken(blind, 3, rng()) is blind


def test_darkness_leaves_the_scan(frame):
    np.testing.assert_array_equal(darken(frame, 3, rng()).points_velo, frame.points_velo)


def test_rays_are_lost_by_their_share_and_more_of_them_with_more(frame):
    some, most = (drop_points(frame, share, rng()).points_velo for share in (0.3, 0.8))
    assert len(some) == pytest.approx(700, abs=45)
    assert len(most) == pytest.approx(200, abs=40)
    assert {point.tobytes() for point in most} < {point.tobytes() for point in some}
    assert len(drop_points(frame, 0.99999, rng()).points_velo) == 1
    assert len(drop_points(frame, 0, rng()).points_velo) == 1000


def test_a_shift_moves_every_point_alike(frame):
    moved_px = pixels(shift_calibration(frame, 8, rng())) - pixels(frame)
    np.testing.assert_allclose(np.linalg.norm(moved_px, axis=1), 8, atol=1e-4)
    np.testing.assert_allclose(moved_px, np.broadcast_to(moved_px[0], moved_px.shape), atol=1e-4)


def test_a_turn_is_by_its_angle_about_the_camera(frame):
    turned = rotate_calibration(frame, 2, rng()).calibration.cam_SE3_velo
    turn = turned[:3, :3] @ CALIBRATION.cam_SE3_velo[:3, :3].T
    assert np.rad2deg(np.arccos((np.trace(turn) - 1) / 2)) == pytest.approx(2)
    camera_velo = np.linalg.inv(CALIBRATION.cam_SE3_velo)[:3, 3]
    np.testing.assert_allclose(turned[:3, :3] @ camera_velo + turned[:3, 3], 0, atol=1e-12)


def test_one_seed_is_one_direction_at_every_level(frame):
    small, large = (pixels(shift_calibration(frame, px, rng())) - pixels(frame) for px in (2, 6))
    np.testing.assert_allclose(3 * small, large, atol=1e-3)


def test_what_cannot_be(frame):
    with fault(UsageError, expected="0 stops or more", found="-1"):
        darken(frame, -1, rng())
    with fault(UsageError, where="point dropout", expected="from 0 to below 1", found="1"):
        drop_points(frame, 1, rng())
    with fault(CalibrationError, expected="a camera's calibration", found="none"):
        rotate_calibration(replace(frame, calibration=None), 1, rng())


def test_without_a_camera_only_points_drop_out():
    found = sensor_corruptions(CorruptionLevels(), has_camera=False, has_images=False)
    assert [one.name for one in found] == ["LiDAR point dropout [share]"]
