"""Poses between the messages of odometry, or of positions and orientations."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from data.bags.drive import BagDrive
from data.kitti.oxts import Mercator
from data.open_drive import open_drive
from perception.geometry.se3 import from_euler, inverse
from tests.bag_writer import FIRST_NS, BagWriter, columns_of

SCAN = np.random.default_rng(1).uniform([-20, -20, -1.8, 0], [20, 20, 1, 1], (400, 4)).astype("f4")
BASE_SE3_LIDAR = from_euler(0, 0, 0, np.array([1.2, 0, 1.9]))
WORLD = Mercator(48.0, 11.0, 500.0)
SECONDS = 1_000_000_000


def pose_at(time_s: float) -> np.ndarray:
    """Return world_SE3_base of 10 m/s and 0.3 rad/s."""
    return from_euler(0, 0, 0.3 * time_s, np.array([10.0 * time_s, 2.0, 0.5]))


def record(folder: Path, write: Callable[[BagWriter], object], frame: str = "velodyne") -> BagDrive:
    """Write scans every 0.1 s and something else, and open the drive."""
    with BagWriter(folder) as bag:
        bag.transforms(FIRST_NS, {("base_link", frame): BASE_SE3_LIDAR})
        for index in range(5):
            bag.cloud("/points", FIRST_NS + index * SECONDS // 10, columns_of(SCAN), frame=frame)
        write(bag)
    drive = open_drive(bag.path)
    assert isinstance(drive, BagDrive)
    return drive


def times_s(rate_hz: float = 40.0) -> np.ndarray:
    return np.arange(-0.11, 0.6, 1 / rate_hz)


def test_odometry_is_interpolated_and_carried_to_the_lidar(tmp_path: Path) -> None:
    def write(bag: BagWriter) -> None:
        for time_s in times_s():
            bag.odometry("/odom", FIRST_NS + round(time_s * 1e9), pose_at(time_s))

    drive = record(tmp_path / "bag", write)
    assert drive.has_poses
    for index in range(5):
        expected = pose_at(index / 10) @ BASE_SE3_LIDAR
        assert np.abs(drive.world_SE3_velo(index) - expected).max() < 1e-5
        assert drive[index].world_SE3_velo is not None


def test_positions_and_orientations_become_poses(tmp_path: Path) -> None:
    imu_SE3_base = from_euler(0, 0, 0, np.array([0.5, -0.2, 0]))
    antenna_imu_m = np.array([-0.4, 0.1, 1.0])

    def write(bag: BagWriter) -> None:
        antenna = from_euler(0, 0, 0, antenna_imu_m)
        edges = {("base_link", "imu"): inverse(imu_SE3_base), ("imu", "antenna"): antenna}
        bag.transforms(FIRST_NS, edges)
        for time_s in times_s():
            world_SE3_imu = pose_at(time_s) @ inverse(imu_SE3_base)
            packet = WORLD.packet(world_SE3_imu @ antenna, *np.zeros((3, 3)))
            place = packet.latitude_deg, packet.longitude_deg, packet.altitude_m
            stamp_ns = FIRST_NS + round(time_s * 1e9)
            bag.fix("/fix", stamp_ns, place, frame="antenna")
            bag.imu("/imu", stamp_ns, world_SE3_imu[:3, :3])

    drive = record(tmp_path / "bag", write)
    first = drive.world_SE3_velo(0)
    for index in range(5):
        # The origin of the world is at the first position.
        expected = inverse(pose_at(0) @ BASE_SE3_LIDAR) @ pose_at(index / 10) @ BASE_SE3_LIDAR
        assert np.abs(inverse(first) @ drive.world_SE3_velo(index) - expected).max() < 1e-4


@pytest.mark.parametrize(
    ("deviation_m", "is_oriented", "reason"),
    [
        (0.02, False, "/imu states no orientation"),
        (3.0, True, "/fix states a deviation of more than 0.5 m"),
    ],
)
def test_positions_that_help_nobody_are_noted(
    tmp_path: Path, deviation_m: float, is_oriented: bool, reason: str
) -> None:
    def write(bag: BagWriter) -> None:
        for time_s in times_s():
            stamp_ns = FIRST_NS + round(time_s * 1e9)
            bag.fix("/fix", stamp_ns, (48.0, 11.0, 500.0), deviation_m)
            bag.imu("/imu", stamp_ns, np.eye(3), is_oriented=is_oriented)

    drive = record(tmp_path / "bag", write)
    assert not drive.has_poses
    assert f"positions are not used for poses, as {reason}" in " ".join(drive.notes)
    assert drive[0].world_SE3_velo is None


def test_poses_of_an_unconnected_frame_are_noted(tmp_path: Path) -> None:
    def write(bag: BagWriter) -> None:
        bag.odometry("/odom", FIRST_NS, np.eye(4), frame="wheels")

    drive = record(tmp_path / "bag", write)
    assert not drive.has_poses
    assert "poses of wheels are not used, as no transform from velodyne to it" in " ".join(
        drive.notes
    )


def test_there_is_no_pose_across_a_gap(tmp_path: Path) -> None:
    def write(bag: BagWriter) -> None:
        for time_s in (-0.6, 0.0, 0.2, 0.3):
            bag.odometry("/odom", FIRST_NS + round(time_s * 1e9), pose_at(time_s))

    drive = record(tmp_path / "bag", write)
    assert [drive.world_SE3_velo(index) is not None for index in range(5)] == [True] * 4 + [False]
