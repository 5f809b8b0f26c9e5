"""What is written is read back, whatever the values: exactly, or to the digits that the format keeps."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from data.folder.stamps import parse_stamp, read_stamps
from data.kitti.calibration import (
    DriveCalibration,
    format_benchmark_calibration,
    read_benchmark_calibration,
)
from data.kitti.oxts import Mercator, format_oxts_packet, parse_oxts_packet
from data.kitti.sensor_files import read_scan
from data.kitti.tracking_rows import TrackingRows, format_result_rows, read_result_rows
from data.results.command_config import CommandConfig, read_config
from data.results.objects import FrameLine
from data.results.records import append_record, read_records
from perception.geometry.se3 import from_euler
from perception.sensor import VLP_16
from perception.sensor.files import load_sensor, sensor_to_json
from perception.types import Calibration

reads_back = settings(max_examples=50, derandomize=True, database=None, deadline=None)

angles_rad = st.floats(-np.pi, np.pi)
metres = st.floats(-9_000, 9_000, width=32)
poses = st.builds(
    lambda roll, pitch, yaw, place: _pose(from_euler(roll, pitch, yaw), place),
    angles_rad,
    st.floats(-1.5, 1.5),
    angles_rad,
    arrays(np.float64, 3, elements=st.floats(-5_000, 5_000)),
)


def _pose(rotation: np.ndarray, place: np.ndarray) -> np.ndarray:
    pose = rotation.copy()
    pose[:3, 3] = place
    return pose


def _through_a_file(name: str, text: str | bytes, read):
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read(path)


@reads_back
@given(st.integers(1, 200).flatmap(lambda n: arrays(np.float32, (n, 4), elements=metres)))
def test_scans(points):
    np.testing.assert_array_equal(_through_a_file("0.bin", points.tobytes(), read_scan), points)


@reads_back
@given(
    focal=st.floats(50, 5_000), centre=st.floats(0, 4_000), cam_SE3_velo=poses, velo_SE3_imu=poses
)
def test_calibrations(focal, centre, cam_SE3_velo, velo_SE3_imu):
    image_P_cam = np.array([[focal, 0, centre, 0], [0, focal, centre, 0], [0, 0, 1, 0]])
    camera = Calibration(image_P_cam, cam_SE3_velo, (1242, 375))
    text = format_benchmark_calibration(DriveCalibration(camera, velo_SE3_imu))
    found = _through_a_file("0000.txt", text, read_benchmark_calibration)
    np.testing.assert_allclose(found.camera.image_P_cam, image_P_cam, rtol=1e-11)
    np.testing.assert_allclose(found.camera.cam_SE3_velo, cam_SE3_velo, atol=1e-7)
    np.testing.assert_allclose(found.velo_SE3_imu, velo_SE3_imu, atol=1e-7)
    assert found.camera.image_size_px == (1242, 375)


@reads_back
@given(latitude=st.floats(-80, 80), longitude=st.floats(-170, 170), world_SE3_imu=poses)
def test_ins_packets(latitude, longitude, world_SE3_imu):
    world, still = Mercator(latitude, longitude, 100.0), np.zeros(3)
    packet = world.packet(world_SE3_imu, still, np.array([0, 0, 9.81]), still)
    found = world.world_SE3_imu(parse_oxts_packet(format_oxts_packet(packet), "packet"))
    np.testing.assert_allclose(found, world_SE3_imu, atol=1e-6)


@st.composite
def _tracking_rows(draw):
    count = draw(st.integers(0, 8))

    def numbers(low, high, *shape):
        values = st.floats(low, high).map(lambda value: round(value, 6))
        return draw(arrays(np.float64, (count, *shape), elements=values))

    corners = numbers(0, 600, 4)
    corners[:, 2:] += corners[:, :2] + 1
    return TrackingRows(
        frames=draw(arrays(np.int64, count, elements=st.integers(0, 1_000))),
        ids=np.arange(count),
        types=np.array(draw(st.lists(st.sampled_from(("Car", "Van", "Cyclist")), min_size=count, max_size=count)), np.str_),
        truncation=np.full(count, -1.0),
        occlusion=np.full(count, -1.0),
        alphas_rad=numbers(-3, 3),
        boxes_px=corners,
        sizes_hwl_m=numbers(0.5, 20, 3),
        bottoms_cam_m=numbers(-200, 200, 3),
        headings_rad=numbers(-3, 3),
        scores=numbers(0, 1),
    )  # fmt: skip


@reads_back
@given(_tracking_rows())
def test_tracking_results(rows):
    found = _through_a_file("0000.txt", format_result_rows(rows), read_result_rows)
    for name, values in vars(rows).items():
        if values.dtype.kind == "U":
            assert getattr(found, name).tolist() == values.tolist()
        else:
            np.testing.assert_allclose(getattr(found, name), values, atol=1e-6, err_msg=name)


@reads_back
@given(st.lists(st.integers(10**18, 9 * 10**18), min_size=1, max_size=5))
def test_stamps_keep_every_nanosecond(stamps_ns):
    seconds = "".join(f"{stamp // 10**9}.{stamp % 10**9:09d}\n" for stamp in stamps_ns)
    read = lambda path: read_stamps(path, len(stamps_ns)).tolist()  # noqa: E731
    assert _through_a_file("times.txt", seconds, read) == stamps_ns
    assert [parse_stamp(str(stamp)) for stamp in stamps_ns] == stamps_ns


@reads_back
@given(st.integers(0, 4_000_000_000), st.integers(0, 999_999_999))
def test_dates_keep_every_nanosecond(seconds, nanoseconds):
    moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=seconds)
    text = f"{moment:%Y-%m-%d %H:%M:%S}.{nanoseconds:09d}"
    assert parse_stamp(text) == seconds * 10**9 + nanoseconds


@reads_back
@given(st.lists(st.builds(FrameLine, st.integers(0, 10**9), st.floats(0, 1e9)), max_size=4))
def test_records(lines):
    with TemporaryDirectory() as folder:
        path = Path(folder) / "frames.jsonl"
        path.touch()
        for line in lines:
            append_record(path, line)
        assert read_records(path, FrameLine) == lines


_values = (
    st.none()
    | st.booleans()
    | st.integers(-(10**9), 10**9)
    | st.floats(-1e9, 1e9)
    | st.text(max_size=8)
)


@reads_back
@given(st.dictionaries(st.from_regex(r"[a-z][a-z_]{0,8}", fullmatch=True), _values, max_size=5))
def test_configurations(values):
    text = CommandConfig("run", values).text()
    assert _through_a_file("config.yaml", text, read_config) == values


@reads_back
@given(
    st.lists(st.floats(-0.6, 0.6), min_size=2, max_size=128, unique=True),
    st.floats(0.001, 0.1),
    st.floats(0.3, 4),
)
def test_sensors(elevations_rad, azimuth_step_rad, height_m):
    highest_first = np.sort(np.array(elevations_rad))[::-1]
    sensor = replace(
        VLP_16,
        name="mine",
        elevations_rad=highest_first,
        azimuth_step_rad=azimuth_step_rad,
        height_m=height_m,
    )
    found = _through_a_file(
        "mine.json", sensor_to_json(sensor), lambda path: load_sensor(str(path))
    )
    np.testing.assert_array_equal(found.elevations_rad, sensor.elevations_rad)
    assert (found.azimuth_step_rad, found.height_m) == (azimuth_step_rad, height_m)
