"""INS packets to poses and back."""

import numpy as np
import pytest

from data.kitti.oxts import (
    InsPacket,
    Mercator,
    format_oxts_packet,
    parse_oxts_packet,
    velocity_world_m_s,
)
from perception.errors import PoseError
from perception.geometry.se3 import from_euler, inverse, rotation_angle_rad
from tests.faults import fault

FIRST = InsPacket(
    latitude_deg=49.0112128,
    longitude_deg=8.4228850,
    altitude_m=112.8,
    roll_rad=0.02,
    pitch_rad=0.001,
    yaw_rad=-1.2,
    velocity_level_m_s=np.array([3.5, 0.04, -0.04]),
    acceleration_imu_m_s2=np.array([-0.3, 0.04, 9.8]),
    rate_imu_rad_s=np.array([-0.02, 0.02, 0.15]),
)
WORLD = Mercator.around(FIRST)


@pytest.mark.parametrize("position_m", [(0, 0, 0), (1200, -800, 15), (-30000, 20000, -40)])
@pytest.mark.parametrize("angles_rad", [(0.03, -0.05, 1.0), (-0.1, 0.2, -3.1), (0, 0, 0)])
def test_a_pose_survives_the_way_through_a_packet_and_its_text(position_m, angles_rad):
    world_SE3_imu = from_euler(*angles_rad, np.array(position_m, float))
    packet = WORLD.packet(world_SE3_imu, np.array([4.0, -3.0, 0.1]), np.zeros(3), np.ones(3))

    read = parse_oxts_packet(format_oxts_packet(packet), "packet")

    again = WORLD.world_SE3_imu(read)
    assert np.linalg.norm(again[:3, 3] - world_SE3_imu[:3, 3]) < 1e-6
    assert rotation_angle_rad(inverse(world_SE3_imu) @ again) < 1e-6
    np.testing.assert_allclose(velocity_world_m_s(read), [4.0, -3.0, 0.1], atol=1e-9)
    np.testing.assert_allclose(read.rate_imu_rad_s, 1)


def test_the_first_packet_is_the_origin():
    np.testing.assert_allclose(WORLD.world_SE3_imu(FIRST)[:3, 3], 0, atol=1e-9)


def test_a_second_of_latitude_is_31_metres_of_north():
    north = InsPacket(**{**vars(FIRST), "latitude_deg": FIRST.latitude_deg + 1 / 3600})
    position_m = WORLD.world_SE3_imu(north)[:3, 3]
    np.testing.assert_allclose(position_m, [0, np.radians(1 / 3600) * 6378137, 0], atol=1e-3)


def test_yaw_is_measured_from_the_east_and_pitch_lowers_the_front():
    east = WORLD.world_SE3_imu(InsPacket(**{**vars(FIRST), "roll_rad": 0.0, "yaw_rad": 0.0}))
    np.testing.assert_allclose(east[:3, 0], [1, 0, -0.001], atol=1e-6)
    np.testing.assert_allclose(
        velocity_world_m_s(InsPacket(**{**vars(FIRST), "yaw_rad": np.pi / 2})),
        [-0.04, 3.5, -0.04],
        atol=1e-12,
    )


@pytest.mark.parametrize(
    ("row", "expected", "found"),
    [
        (" ".join(["0"] * 29), "30 finite numbers", "29"),
        (" ".join(["0"] * 29 + ["x"]), "numbers", "'0 0"),
        (" ".join(["0"] * 29 + ["nan"]), "30 finite numbers", "29"),
        (" ".join(["95"] + ["0"] * 29), "a latitude within 89", "95 and 0"),
    ],
    ids=["too short", "no number", "not finite", "off the map"],
)
def test_a_bad_packet_is_named(row, expected, found):
    with fault(PoseError, where="oxts/0000.txt row 7", expected=expected, found=found):
        parse_oxts_packet(row, "oxts/0000.txt row 7")
