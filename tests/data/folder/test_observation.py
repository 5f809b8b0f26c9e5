"""What is seen of a folder: sensor, axes, tilt, height, scale and rate, and how sure it is."""

from dataclasses import replace

import numpy as np
import pytest

from data.clouds.lidar_estimate import fitting_models
from data.folder.observation import observe_folder
from perception.errors import DriveError, ScanError
from perception.sensor import HDL_32E, SENSORS, VLP_16, LidarModel
from tests.data.folder.conftest import road_scan
from tests.faults import fault

OWN = LidarModel(
    "own", np.radians(np.linspace(20, -24, 45)), np.radians(0.5), 10.0, 1.8, 0.5, 100.0, 0.02
)
# Columns of the files from ours.
Y_FORWARD = [lambda p: -p[:, 1], lambda p: p[:, 0], lambda p: p[:, 2]]
CAMERA = [lambda p: -p[:, 1], lambda p: -p[:, 2], lambda p: p[:, 0]]


def turned(points, columns):
    return np.column_stack([*(column(points) for column in columns), points[:, 3]])


@pytest.mark.parametrize(
    ("sensor", "height_m", "tilt_deg", "columns", "axes"),
    [
        (HDL_32E, 1.73, (0, 0), None, ("forward", "left", "up")),
        (VLP_16, 2.2, (0, 5), Y_FORWARD, ("right", "forward", "up")),
        (HDL_32E, 1.2, (-4, -3), CAMERA, ("right", "down", "forward")),
    ],
)
def test_sensor_and_mounting_are_seen(write_folder, sensor, height_m, tilt_deg, columns, axes):
    model = replace(sensor, height_m=height_m)
    scans = [road_scan(index, model, tilt_deg) for index in range(4)]
    folder = write_folder([turned(p, columns) if columns else p for p in scans])
    found = observe_folder(folder)
    lidar = found.config.lidar
    assert (lidar.sensor, lidar.axes, lidar.scans) == (sensor.name, axes, "lidar")
    assert lidar.height_m == pytest.approx(height_m, abs=0.02)
    assert (lidar.roll_deg, lidar.pitch_deg) == pytest.approx(tilt_deg, abs=0.3)
    assert {one.what for one in found.guesses} == {"times", "rate"}


def test_an_unknown_sensor_is_a_table_of_its_beams(write_folder):
    found = observe_folder(write_folder([road_scan(index, OWN) for index in range(3)]))
    lidar = found.config.lidar
    assert lidar.sensor == "LiDAR with 45 beams"
    np.testing.assert_allclose(lidar.elevations_deg, np.degrees(OWN.elevations_rad), atol=0.1)
    assert lidar.azimuth_step_deg == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(
    ("half_deg", "sensor", "certainty"),
    [(35.2, "Avia", "likely"), (40.8, "Horizon", "likely"), (25.0, "LiDAR with", "guess")],
)
def test_returns_that_follow_no_rings_are_of_a_lidar_without(
    write_folder, half_deg, sensor, certainty
):
    rng = np.random.default_rng(3)
    azimuth = np.radians(rng.uniform(-half_deg, half_deg, 20_000))
    elevation = np.radians(rng.uniform(-12, 12, 20_000))
    range_m = np.minimum(1.9 / np.sin(np.maximum(-elevation, 0.05)), 30 / np.cos(azimuth))
    flat_m = range_m * np.cos(elevation)
    points = [flat_m * np.cos(azimuth), flat_m * np.sin(azimuth), range_m * np.sin(elevation)]
    found = observe_folder(write_folder([np.column_stack([*points, np.full(20_000, 0.5)])]))
    (seen,) = (one for one in found.observations if one.what == "sensor")
    assert found.config.lidar.sensor.startswith(sensor)
    assert (seen.certainty, "follow no rings" in seen.reason) == (certainty, True)


def test_rings_of_the_files_are_the_beams(write_folder):
    scan = road_scan(0)
    rays = np.arctan2(scan[:, 2], np.hypot(scan[:, 0], scan[:, 1]))
    ring = np.abs(rays[:, None] - HDL_32E.elevations_rad).argmin(axis=1)
    found = observe_folder(write_folder([np.column_stack([scan, ring])]))
    (sensor,) = (one for one in found.observations if one.what == "sensor")
    assert sensor.value == "HDL-32E"
    assert "rings of the files" in sensor.reason


def test_rings_of_points_about_another_origin_are_a_guess(write_folder):
    scan = road_scan(0)
    rays = np.arctan2(scan[:, 2], np.hypot(scan[:, 0], scan[:, 1]))
    ring = np.abs(rays[:, None] - HDL_32E.elevations_rad).argmin(axis=1)
    scan[:, :3] += [1.5, 0, 1.5]
    found = observe_folder(write_folder([np.column_stack([scan, ring])]))
    (sensor,) = (one for one in found.guesses if one.what == "sensor")
    assert "not about the origin of one LiDAR" in sensor.reason


def test_the_model_with_fewer_unseen_beams_comes_first():
    assert fitting_models(SENSORS["OS1-32"].elevations_rad)[0][0] == "OS1-32"
    assert fitting_models(SENSORS["OS0-64"].elevations_rad)[0][0] == "OS0-64"


@pytest.mark.parametrize("noise_m", [0.0, 0.01])
def test_standing_shows_no_forward(write_folder, noise_m):
    scans = [road_scan(0), road_scan(0)]
    for seed, scan in enumerate(scans):
        scan[:, :3] += noise_m * np.random.default_rng(seed).standard_normal((len(scan), 3))
    found = observe_folder(write_folder(scans))
    assert {one.what for one in found.guesses} == {"axes", "tilt", "times", "rate"}


@pytest.mark.parametrize(("largest", "scale"), [(1, 1), (200, 255), (4000, 65535)])
def test_the_scale_of_reflectance_is_seen(write_folder, largest, scale):
    scan = road_scan(0)
    scan[:, 3] *= largest
    assert observe_folder(write_folder([scan])).config.lidar.reflectance_scale == scale


def test_reflectance_that_is_always_0_is_none(write_folder):
    scan = road_scan(0)
    scan[:, 3] = 0
    found = observe_folder(write_folder([scan]))
    (seen,) = (one for one in found.observations if one.what == "reflectance")
    assert (seen.value, seen.reason) == ("none", "all values are 0")


def test_the_rate_is_that_of_the_names(tmp_path):
    for index in range(3):
        np.save(
            tmp_path / f"{1_317_036_272_000_000_000 + index * 50_000_000}.npy", road_scan(index)
        )
    found = observe_folder(tmp_path)
    assert (found.config.lidar.rate_hz, found.config.lidar.scans) == (20.0, ".")


def test_columns_of_bin_files_are_seen(tmp_path):
    scan = road_scan(0)
    rows = np.column_stack([scan, np.arange(len(scan)) % 32]).astype(np.float32)
    rows.tofile(tmp_path / "000000.bin")
    lidar = observe_folder(tmp_path).config.lidar
    assert lidar.columns == ("x", "y", "z", "intensity", "ring")


def test_a_folder_without_scans_is_an_error(tmp_path):
    (tmp_path / "notes.txt").touch()
    with fault(DriveError, where=str(tmp_path), expected="scans", found="notes.txt"):
        observe_folder(tmp_path)


def test_scans_that_cannot_be_read_are_an_error(tmp_path):
    (tmp_path / "a.npy").write_bytes(b"text")
    with fault(ScanError, where="a.npy", expected="an array of NumPy"):
        observe_folder(tmp_path)


def test_scans_of_a_few_points_are_guessed_at(write_folder):
    found = observe_folder(write_folder([np.ones((30, 4), np.float32)]))
    assert {"sensor", "height", "axes"} <= {one.what for one in found.guesses}
    assert found.config.lidar.height_m is None
