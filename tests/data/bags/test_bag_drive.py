"""Drives in bags: the same as in KITTI's layout, and what robots record beside it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from data.bags.drive import BagDrive
from data.inspection import inspect_drive
from data.layouts import OpenConfig
from data.open_drive import open_drive
from data.synthetic.drive import SyntheticDrive
from perception.errors import CalibrationError, DriveError, UsageError
from perception.geometry.se3 import from_euler, inverse, transform_points
from perception.sensor import VLP_16, sensor_to_json
from tests.bag_writer import FIRST_NS, KINDS, BagWriter, columns_of, write_bag

SCAN = np.random.default_rng(1).uniform([-20, -20, -1.8, 0], [20, 20, 1, 1], (600, 4)).astype("f4")
MATRIX = np.array([[40.0, 0, 32], [0, 40, 24], [0, 0, 1]])
CAMERA_SE3_LIDAR = np.array([[0, -1, 0, 0.0], [0, 0, -1, -0.1], [1, 0, 0, -0.2], [0, 0, 0, 1]])
IMAGE = np.random.default_rng(2).integers(0, 255, (48, 64, 3), np.uint8)
PERIOD_NS = 100_000_000


def opened(bag: BagWriter, **config: object) -> BagDrive:
    drive = open_drive(bag.path, config=OpenConfig(**config))  # type: ignore[arg-type]
    assert isinstance(drive, BagDrive)
    return drive


def write_scans(bag: BagWriter, count: int = 4, topic: str = "/points", **layout: object) -> None:
    for index in range(count):
        bag.cloud(topic, FIRST_NS + index * PERIOD_NS, columns_of(SCAN), **layout)


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_gives_the_frames_of_the_drive_it_was_made_from(
    tmp_path: Path, raw_drive: Path, kind: str
) -> None:
    kitti = open_drive(raw_drive)
    drive = open_drive(write_bag(kitti, tmp_path / "bag", kind), sensor="HDL-64E")
    assert isinstance(drive, BagDrive)
    assert len(drive) == len(kitti)
    for expected, found in zip(kitti, drive, strict=True):
        assert np.array_equal(found.points_velo, expected.points_velo)
        assert np.array_equal(found.image, expected.image)
        assert np.allclose(found.world_SE3_velo, expected.world_SE3_velo, atol=1e-9)
        assert np.allclose(found.calibration.image_P_velo, expected.calibration.image_P_velo)
        assert abs(found.stamp_s - expected.stamp_s) < 1e-9
        assert (found.name, found.number) == (f"{expected.number:06d}", expected.number)
    assert drive.sensor.rate_hz == pytest.approx(10)
    assert drive.notes == ()
    assert inspect_drive(drive).faults == inspect_drive(kitti).faults


def test_parts_of_a_drive_keep_their_numbers(tmp_path: Path, raw_drive: Path) -> None:
    drive = open_drive(write_bag(open_drive(raw_drive), tmp_path / "bag"))
    part = drive.select([3, 1])
    assert part.frame_numbers == (3, 1)
    assert part.stamp_s(1) == drive.stamp_s(1)
    assert part.fingerprint(0) == drive.fingerprint(3)
    assert part.source(0).endswith("/velodyne_points message 3")
    assert part.point_truth(0) is None
    assert not part.has_labels
    with pytest.raises(DriveError, match="expected a drive with labelled boxes, found none"):
        part.labels(0)


def test_a_drive_without_images_is_asked_for(tmp_path: Path, raw_drive: Path) -> None:
    path = write_bag(open_drive(raw_drive), tmp_path / "bag")
    drive = open_drive(path, images=False)
    assert not drive.has_images
    assert drive[0].image is None
    assert drive.calibration is not None


def write_camera(bag: BagWriter, topic: str = "/cam/image_raw", **info: object) -> None:
    """Write images at twice the rate of the scans, from the second scan on."""
    for index in range(2, 8):
        stamp_ns = FIRST_NS + index * PERIOD_NS // 2 + 1_000_000
        bag.png(topic, stamp_ns, np.full_like(IMAGE, 10 * index))
    bag.camera_info("/cam/camera_info", FIRST_NS, MATRIX, (64, 48), **info)


def test_images_are_joined_by_time(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        bag.transforms(FIRST_NS, {("camera", "velodyne"): CAMERA_SE3_LIDAR})
        write_scans(bag)
        write_camera(bag)
    drive = opened(bag)
    assert drive.image(0) is None
    assert [int(drive.image(index)[0, 0, 0]) for index in (1, 2, 3)] == [20, 40, 60]
    assert np.allclose(drive.calibration.cam_SE3_velo, CAMERA_SE3_LIDAR)


def test_distorted_images_are_undistorted(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        bag.transforms(FIRST_NS, {("camera", "velodyne"): CAMERA_SE3_LIDAR})
        write_scans(bag)
        bag.image("/cam/image_raw", FIRST_NS, IMAGE)
        bag.image("/cam/image_rect", FIRST_NS, IMAGE)
        coefficients = (-0.3, 0.1, 0, 0, 0)
        bag.camera_info("/cam/camera_info", FIRST_NS, MATRIX, (64, 48), coefficients=coefficients)
    raw, rectified = opened(bag), opened(bag, camera="/cam/image_rect")
    lens = raw.images.lens
    assert np.array_equal(lens.coefficients, coefficients)
    assert np.array_equal(raw.image(0), lens.undistort(IMAGE))
    assert np.array_equal(rectified.image(0), IMAGE)
    assert np.allclose(rectified.calibration.image_P_cam, raw.calibration.image_P_cam)
    assert "images of /cam/image_raw among /cam/image_raw, /cam/image_rect" in raw.notes[0]


def test_a_camera_that_cannot_be_used_is_noted_or_refused_where_it_is_named(
    tmp_path: Path,
) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        write_scans(bag)
        write_camera(bag)
        bag.image("/bare/image", FIRST_NS, IMAGE)
    drive = opened(bag)
    assert not drive.has_images
    missing = "expected a transform from velodyne to camera in /tf_static or /tf"
    assert missing in " ".join(drive.notes)
    with pytest.raises(CalibrationError, match=missing):
        opened(bag, camera="/cam/image_raw")
    with pytest.raises(CalibrationError, match="/bare/image: expected a topic camera_info"):
        opened(bag, camera="/bare/image")


def test_several_lidars_become_one(tmp_path: Path) -> None:
    left, right = from_euler(0, 0, 0.5, np.array([0, 1.0, 0])), from_euler(0, 0.1, -0.4)
    right[:3, 3] = 0.2, -1.0, 0.1
    with BagWriter(tmp_path / "bag") as bag:
        bag.transforms(FIRST_NS, {("roof", "left"): left, ("roof", "right"): right})
        write_scans(bag, 4, "/left", frame="left")
        for index in range(3):
            stamp_ns = FIRST_NS + index * PERIOD_NS + 20_000_000
            bag.cloud("/right", stamp_ns, columns_of(SCAN[:100]), frame="right")
    drive = opened(bag, lidar="/left, right")
    frame = drive[1]
    moved = transform_points(inverse(left) @ right, SCAN[:100])
    assert np.allclose(frame.points_velo, np.concatenate([SCAN, moved]), atol=1e-5)
    assert np.allclose(frame.point_times_s, np.repeat([0, 0.02], [600, 100]))
    assert len(drive[3].points_velo) == 600
    alone = opened(bag)
    assert len(alone[1].points_velo) == 600
    assert "scans of /left among /left, /right; others with --lidar" in alone.notes[0]


def test_a_lidar_that_is_not_connected_is_named(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        write_scans(bag, 2, "/left", frame="left")
        write_scans(bag, 2, "/right", frame="right")
    missing = "expected a transform from right to left in .*, to merge the scans of /right"
    with pytest.raises(CalibrationError, match=missing):
        opened(bag, lidar="/left,/right")


def test_points_are_turned_to_the_axes_of_the_vehicle(tmp_path: Path) -> None:
    mounting = from_euler(0, 0.1, np.pi / 2, np.array([0.3, 0.1, 1.9]))
    with BagWriter(tmp_path / "bag") as bag:
        edges = {("base_footprint", "base_link"): np.eye(4), ("base_link", "velodyne"): mounting}
        bag.transforms(FIRST_NS, edges)
        write_scans(bag)
        for index in range(4):
            bag.odometry("/odom", FIRST_NS + index * PERIOD_NS, np.eye(4))
    drive = opened(bag)
    expected = transform_points(mounting, SCAN)
    expected[:, :3] -= mounting[:3, 3].astype(np.float32)
    assert np.allclose(drive[0].points_velo, expected, atol=1e-5)
    assert drive.sensor.height_m == pytest.approx(1.9)
    assert "points of velodyne are turned to the axes of base_link" in " ".join(drive.notes)
    # The pose is that of the turned axes at the LiDAR.
    expected_pose = np.eye(4)
    expected_pose[:3, 3] = mounting[:3, 3]
    assert np.allclose(drive.world_SE3_velo(0), expected_pose)


def test_repeated_stamps_are_left_out(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        write_scans(bag)
        bag.cloud("/points", FIRST_NS + PERIOD_NS, columns_of(SCAN))
    drive = opened(bag)
    assert len(drive) == 4
    assert "1 scans are left out, as their stamps are those of others" in " ".join(drive.notes)


def test_intensities_are_scaled_for_the_whole_drive(tmp_path: Path) -> None:
    bright = SCAN * np.array([1, 1, 1, 200], np.float32)
    with BagWriter(tmp_path / "bag") as bag:
        for index in range(3):
            bag.cloud("/points", FIRST_NS + index * PERIOD_NS, columns_of(bright))
    drive = opened(bag)
    assert np.allclose(drive[0].points_velo[:, 3], bright[:, 3] / 255)
    assert "divided by 255" in " ".join(drive.notes)
    assert np.allclose(
        opened(bag, reflectance_scale=400.0)[0].points_velo[:, 3], bright[:, 3] / 400
    )


def test_the_lidar_is_estimated_by_its_beams_and_its_ground(tmp_path: Path) -> None:
    drive = SyntheticDrive(2, seed=3, sensor=replace(VLP_16, height_m=2.1), images=False)
    with BagWriter(tmp_path / "bag") as bag:
        for index in range(2):
            points = drive[index].points_velo
            bag.cloud("/points", FIRST_NS + index * PERIOD_NS // 2, columns_of(points))
    found = opened(bag)
    assert found.sensor.name == "VLP-16"
    assert found.sensor.height_m == pytest.approx(2.1, abs=0.1)
    assert found.sensor.rate_hz == pytest.approx(20)
    assert "the beams are those of VLP-16; name another with --sensor" in found.notes[0]
    named = opened(bag, sensor="hdl-32e")
    assert named.sensor.name == "HDL-32E"
    assert named.sensor.height_m == found.sensor.height_m


def test_scans_of_an_unknown_lidar_are_noted(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        bag.cloud("/points", FIRST_NS, columns_of(SCAN[:300]))
    drive = opened(bag)
    assert drive.sensor.name == "HDL-64E"
    assert "too few returns to tell the LiDAR; it is taken as HDL-64E" in " ".join(drive.notes)
    (tmp_path / "bag" / "sensor.json").write_text(sensor_to_json(replace(VLP_16, height_m=3.0)))
    assert opened(bag).sensor.height_m == 3.0


def room(pose: np.ndarray) -> np.ndarray:
    """Return (N, 4) points on the walls and the pillars of a hall, as seen from a pose."""
    rng = np.random.default_rng(4)
    along = rng.uniform(-40, 40, (3000, 1))
    up = rng.uniform(-1.5, 3, (3000, 1))
    sides = np.hstack([along, np.where(rng.random((3000, 1)) < 0.5, -6.0, 7.0), up])
    ends = np.hstack([np.full((600, 1), 30.0), rng.uniform(-6, 7, (600, 1)), up[:600]])
    floor = np.hstack([along, rng.uniform(-6, 7, (3000, 1)), np.full((3000, 1), -1.5)])
    pillars = np.repeat(rng.uniform([-20, -5, 0], [25, 6, 0], (30, 3)), 60, axis=0)
    pillars += rng.uniform([-0.2, -0.2, -1.5], [0.2, 0.2, 2], pillars.shape)
    points = np.concatenate([sides, ends, floor, pillars]).astype(np.float32)
    points = np.hstack([points, np.full((len(points), 1), 0.5, np.float32)])
    return transform_points(inverse(pose), points)


def speed_pose(time_s: float) -> np.ndarray:
    return from_euler(0, 0, 0.2 * time_s, np.array([8.0 * time_s, 0, 0]))


@pytest.mark.parametrize("has_poses", [True, False])
def test_sweeps_are_deskewed_with_and_without_poses(tmp_path: Path, has_poses: bool) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        bag.transforms(FIRST_NS, {("base_link", "velodyne"): np.eye(4)})
        for index in range(4):
            stamp_ns, stamp_s = FIRST_NS + index * PERIOD_NS, index / 10
            if has_poses:
                bag.odometry("/odom", stamp_ns, speed_pose(stamp_s))
            exact = room(speed_pose(stamp_s))
            times_s = np.random.default_rng(index).uniform(-0.1, 0, len(exact)).astype("f4")
            measured = exact.copy()
            for step in np.linspace(-0.1, 0, 41)[:-1]:
                rows = np.flatnonzero((times_s >= step) & (times_s < step + 0.0025))
                times_s[rows] = step
                measured[rows] = room(speed_pose(stamp_s + step))[rows]
            bag.cloud("/points", stamp_ns, columns_of(measured) | {"time": times_s})
    raw, deskewed = opened(bag), opened(bag, deskew=True)
    for index in (0, 2, 3, 1):
        exact = room(speed_pose(index / 10))
        off_m, left_m = (
            np.linalg.norm((drive[index].points_velo - exact)[:, :3], axis=1).mean()
            for drive in (raw, deskewed)
        )
        assert off_m > 0.3
        assert left_m < (0.01 if has_poses else 0.03)


def test_deskewing_without_times_is_an_error(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        write_scans(bag)
    with pytest.raises(UsageError, match=r"--deskew: expected a time for each point, found none"):
        opened(bag, deskew=True)[0]


def test_two_topics_of_images(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        bag.transforms(FIRST_NS, {("camera", "velodyne"): CAMERA_SE3_LIDAR})
        write_scans(bag)
        bag.image("/cam/image_rect", FIRST_NS, IMAGE)
        bag.camera_info("/cam/camera_info", FIRST_NS, MATRIX, (64, 48))
        bag.image("/other/image_rect", FIRST_NS, 255 - IMAGE)
        bag.camera_info("/other/camera_info", FIRST_NS, MATRIX, (64, 48))
    frame = opened(bag, camera="/cam/image_rect,/other/image_rect")[0]
    assert [view.camera for view in frame.views] == ["/cam/image_rect", "/other/image_rect"]
    assert np.array_equal(frame.image, IMAGE)
    assert np.array_equal(frame.further_cameras[0].image, 255 - IMAGE)
