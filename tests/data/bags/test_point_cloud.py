"""PointCloud2 messages of any form, read back."""

from pathlib import Path

import numpy as np
import pytest

from data.bags.sweeps import BagLidar, point_times_s, points_velo, read_point_cloud
from data.clouds.cloud import Cloud
from perception.errors import ScanError
from perception.geometry.se3 import from_euler
from tests.bag_writer import BagWriter, columns_of

POINTS = np.array(
    [[1, 2, 3, 10], [4, 5, 6, 20], [7, 8, 9, 30], [-1, -2, 0.5, 40], [2, 2, 2, 50], [3, 1, 0, 60]],
    np.float32,
)


@pytest.fixture
def writer(tmp_path: Path) -> BagWriter:
    return BagWriter(tmp_path / "bag")


@pytest.mark.parametrize(
    "layout",
    [
        {},
        {"padding": 4},
        {"rows": 2},
        {"rows": 3, "row_padding": 7, "padding": 1},
        {"big_endian": True},
    ],
    ids=["plain", "padded", "organised", "organised with gaps", "big-endian"],
)
def test_points_keep_values_and_order(writer: BagWriter, layout: dict) -> None:
    cloud = read_point_cloud(writer.cloud_message(0, columns_of(POINTS), **layout), "scan")
    assert np.array_equal(cloud.xyz, POINTS[:, :3])
    assert np.array_equal(cloud.intensity, POINTS[:, 3])


def test_fields_of_any_type_and_order_are_found_by_name(writer: BagWriter) -> None:
    columns = {
        "ring": np.arange(6, dtype="u2"),
        "z": POINTS[:, 2].astype("f8"),
        "t": np.arange(6, dtype="u4") * 10_000_000,
        "y": POINTS[:, 1].astype("f8"),
        "intensity": np.full(6, 900.0, "f4"),
        "reflectivity": np.arange(6, dtype="u1"),
        "x": POINTS[:, 0].astype("f8"),
    }
    cloud = read_point_cloud(writer.cloud_message(0, columns), "scan")
    assert np.array_equal(cloud.xyz, POINTS[:, :3])
    assert np.array_equal(cloud.ring, np.arange(6))
    assert np.array_equal(cloud.intensity, np.arange(6))  # calibrated, where a sensor gives both
    assert np.allclose(cloud.times_s, np.arange(6) * 0.01)


def test_a_cloud_without_z_is_an_error(writer: BagWriter) -> None:
    columns = dict.fromkeys(("x", "y", "intensity"), POINTS[:, 0])
    with pytest.raises(ScanError, match=r"^bag /v 3: expected columns x, y and z, found x, y, int"):
        read_point_cloud(writer.cloud_message(0, columns), "bag /v 3")


def test_too_few_bytes_are_an_error(writer: BagWriter) -> None:
    message = writer.cloud_message(0, columns_of(POINTS))
    message.data = message.data[:-1]
    with pytest.raises(ScanError, match=r"1 rows of 6 points of 16 bytes, 96 bytes.*found 95"):
        read_point_cloud(message, "scan")


def test_a_field_beyond_its_point_is_an_error(writer: BagWriter) -> None:
    message = writer.cloud_message(0, columns_of(POINTS))
    message.fields[3].offset = 14
    with pytest.raises(ScanError, match=r"fields within a point.*fields up to byte 18"):
        read_point_cloud(message, "scan")


def test_an_impossible_number_of_points_is_an_error(writer: BagWriter) -> None:
    message = writer.cloud_message(0, columns_of(POINTS))
    message.width, message.point_step, message.fields = 2**31, 0, []
    with pytest.raises(ScanError, match=r"at most 20000000 points"):
        read_point_cloud(message, "scan")


def test_points_are_scaled_moved_and_kept_without_a_return() -> None:
    xyz = np.array([[1, 0, 0], [np.nan, 1, 1], [0, 0, 0], [0, 2, 0]], np.float32)
    cloud = Cloud(xyz, intensity=np.array([51, 255, 9, 300], np.float32))
    turn = from_euler(0, 0, np.pi / 2, np.array([0, 0, 1.0]))
    lidar = BagLidar(None, turn, full_scale=255.0)  # type: ignore[arg-type]
    expected = np.array([[0, 1, 1, 0.2], [0, 0, 0, 0], [0, 0, 0, 0], [-2, 0, 1, 1]])
    assert np.allclose(points_velo(cloud, lidar), expected, atol=1e-6)


@pytest.mark.parametrize(
    ("times_s", "expected"),
    [
        ([0.0, 0.05, 0.1], [0.0, 0.05, 0.1]),
        ([-0.1, -0.05, 0.0], [-0.1, -0.05, 0.0]),
        ([1700000000.15, 1700000000.2, 1700000000.25], [-0.05, 0.0, 0.05]),
        ([77.0, 77.05, 77.1], [0.0, 0.05, 0.1]),
    ],
    ids=["from the start", "to the end", "since the epoch", "by a clock of the sensor"],
)
def test_times_become_seconds_from_the_stamp(times_s: list[float], expected: list[float]) -> None:
    cloud = Cloud(np.ones((3, 3), np.float32), times_s=np.array(times_s))
    assert np.allclose(point_times_s(cloud, 1_700_000_000_200_000_000), expected, atol=1e-6)


def test_clouds_without_times_have_none() -> None:
    assert point_times_s(Cloud(np.ones((3, 3), np.float32)), 0) is None
