"""The beams of a scan tell its sensor."""

import numpy as np
import pytest

from data.beam_pattern import BeamPattern, beam_anomalies
from data.inspection import inspect_drive
from data.open_drive import open_drive
from perception.sensor import HDL_32E, HDL_64E, SENSORS, VLP_16, LidarModel
from perception.types import Frame


def take_scan(sensor: LidarModel) -> Frame:
    """Take a scan of a flat road between walls, each beam every fifth firing, 3 % without a return."""
    rng = np.random.default_rng(0)
    azimuths = np.arange(0, 2 * np.pi, 5 * sensor.azimuth_step_rad)
    elevation, azimuth = np.meshgrid(sensor.elevations_rad, azimuths)
    elevation = elevation + rng.normal(0, np.radians(0.01), elevation.shape)
    to_road_m = sensor.height_m / np.maximum(-np.tan(elevation), 1e-3)
    to_wall_m = 12 / np.maximum(np.abs(np.sin(azimuth)), 0.1)
    across_m = np.minimum(to_road_m, to_wall_m)
    x, y, z = (across_m * one for one in (np.cos(azimuth), np.sin(azimuth), np.tan(elevation)))
    points = np.stack([x, y, z, np.full_like(x, 0.3)], axis=-1, dtype=np.float32)
    return Frame(0, 0.0, points[rng.random(x.shape) < 0.97])


WITH_RINGS = {name: sensor for name, sensor in SENSORS.items() if sensor.has_rings}


@pytest.mark.parametrize("sensor", WITH_RINGS.values(), ids=WITH_RINGS)
def test_a_scan_fits_its_own_sensor_best(sensor):
    pattern = BeamPattern.of(take_scan(sensor).points_velo)
    assert pattern.fitting_sensors()[0] == sensor.name
    # The lowest beams of some end before the nearest distance that is used.
    assert pattern.lines == pytest.approx(sensor.beams, rel=0.21)
    middle_rad = np.median(-np.diff(sensor.elevations_rad))
    assert pattern.spacing_rad == pytest.approx(middle_rad, rel=0.2)


@pytest.mark.parametrize("sensor", [HDL_64E, SENSORS["VLS-128"], SENSORS["OS1-128"]])
def test_a_scan_of_many_beams_fits_its_own_sensor_alone(sensor):
    pattern = BeamPattern.of(take_scan(sensor).points_velo)
    assert pattern.fitting_sensors() == [sensor.name]


def test_a_sensor_without_rings_has_no_pattern():
    assert list(beam_anomalies(take_scan(VLP_16), SENSORS["Avia"])) == []


@pytest.mark.parametrize(
    ("true", "stated"),
    [(VLP_16, HDL_64E), (HDL_32E, HDL_64E), (HDL_64E, VLP_16), (VLP_16, HDL_32E)],
)
def test_another_sensor_is_named(true, stated):
    (anomaly,) = beam_anomalies(take_scan(true), stated)
    assert f"expected {stated.beams} beams" in anomaly.example
    assert f"--sensor {true.name}" in anomaly.example


def test_a_sensor_that_is_unknown_is_described():
    frame = take_scan(HDL_64E)
    stretched = frame.points_velo * np.float32([1, 1, 3, 1])
    (anomaly,) = beam_anomalies(Frame(0, 0.0, stretched), HDL_64E)
    assert "as no known model fits" in anomaly.example


def test_few_returns_give_no_pattern():
    frame = Frame(0, 0.0, take_scan(VLP_16).points_velo[::200])
    assert BeamPattern.of(frame.points_velo) is None
    assert list(beam_anomalies(frame, HDL_64E)) == []


def test_check_finds_the_fault(raw_drive):
    for path in (raw_drive / "velodyne_points/data").iterdir():
        take_scan(VLP_16).points_velo.tofile(path)
    found = {one.what: one for one in inspect_drive(open_drive(raw_drive)).findings}
    assert (found["beams of another sensor"].count, found["beams of another sensor"].is_fault) == (
        1,
        True,
    )


def test_kitti_fits_an_hdl_64e(kitti_root):
    for frame in open_drive(kitti_root / "object", images=False):
        assert list(beam_anomalies(frame, HDL_64E)) == []
