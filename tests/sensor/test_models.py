"""LiDAR models are those of the data sheets."""

import numpy as np
import pytest

from perception.errors import UsageError
from perception.sensor import HDL_64E, SENSORS, LidarModel
from tests.faults import fault

# Name, beams, highest and lowest elevation, smallest and largest step, firings a turn.
DATA_SHEETS = [
    ("HDL-64E", 64, 2.0, -24.33, 0.333, 0.5, 2083),
    ("HDL-32E", 32, 10.67, -30.67, 1.33, 1.34, 2169),
    ("VLP-16", 16, 15.0, -15.0, 2.0, 2.0, 1800),
    ("VLP-32C", 32, 15.0, -25.0, 0.333, 9.361, 1800),
    ("VLS-128", 128, 15.0, -25.0, 0.11, 5.418, 1800),
    ("OS0-128", 128, 45.0, -45.0, 0.708, 0.709, 1024),
    ("OS1-64", 64, 22.5, -22.5, 0.714, 0.715, 1024),
    ("OS2-32", 32, 11.25, -11.25, 0.725, 0.726, 1024),
    ("Pandar40P", 40, 15.0, -25.0, 0.333, 6.0, 1800),
    ("Pandar64", 64, 14.882, -24.897, 0.162, 6.008, 1800),
    ("QT64", 64, 52.133, -52.121, 1.45, 2.338, 600),
    ("XT32", 32, 15.0, -16.0, 1.0, 1.0, 2000),
    ("AT128", 128, 12.9, -12.5, 0.2, 0.2, 3600),
]


@pytest.mark.parametrize("row", DATA_SHEETS, ids=lambda row: row[0])
def test_a_model_is_that_of_its_data_sheet(row):
    name, beams, *angles_deg, columns = row
    sensor = SENSORS[name]
    elevations_deg = np.degrees(sensor.elevations_rad)
    steps_deg = -np.diff(elevations_deg)
    found = [elevations_deg[0], elevations_deg[-1], steps_deg.min(), steps_deg.max()]
    assert (sensor.beams, sensor.columns, sensor.has_rings) == (beams, columns, True)
    assert found == pytest.approx(angles_deg, abs=0.01)


def test_tables_of_the_manuals():
    """Elevations in the order of the laser IDs: of the VLP-32C table 9-6 of 63-9325 revision C."""
    by_laser_deg = [
        -25.0, -1.0, -1.667, -15.639, -11.310, 0.0, -0.667, -8.843, -7.254, 0.333, -0.333, -6.148, -5.333, 1.333, 0.667,
        -4.0, -4.667, 1.667, 1.0, -3.667, -3.333, 3.333, 2.333, -2.667, -3.0, 7.0, 4.667, -2.333, -2.0, 15.0, 10.333,
        -1.333,
    ]  # fmt: skip
    found_deg = np.degrees(SENSORS["VLP-32C"].elevations_rad)
    assert found_deg == pytest.approx(sorted(by_laser_deg, reverse=True))
    hdl_32e_deg = [k * 4 / 3 for k in range(-23, 9)]
    assert np.degrees(SENSORS["HDL-32E"].elevations_rad) == pytest.approx(
        sorted(hdl_32e_deg, reverse=True), abs=0.005
    )


def test_the_beams_of_a_vlp_32c_are_closest_around_the_horizon():
    elevations_deg = np.degrees(SENSORS["VLP-32C"].elevations_rad)
    middle = elevations_deg[(elevations_deg < 1.7) & (elevations_deg > -4.1)]
    assert -np.diff(middle) == pytest.approx(1 / 3, abs=0.01)
    assert len(middle) == 18


@pytest.mark.parametrize(
    ("name", "points"), [("Avia", 24_000), ("Horizon", 24_000), ("Mid-360", 20_000)]
)
def test_a_sensor_without_rings_has_as_many_cells_as_points_in_a_scan(name, points):
    sensor = SENSORS[name]
    columns = sensor.field_of_view_rad / sensor.azimuth_step_rad
    assert not sensor.has_rings
    assert sensor.beams * columns == pytest.approx(points, rel=0.03)
    assert sensor.elevation_step_rad == pytest.approx(sensor.azimuth_step_rad, rel=0.02)


def changed(**values) -> LidarModel:
    return LidarModel(**{**vars(HDL_64E), **values})


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({"elevations_rad": [0.1, 0.1]}, "highest first"),
        ({"elevations_rad": [15.0, -15.0]}, "from -pi/2 to pi/2"),
        ({"height_m": 0.0}, "a positive height_m"),
        ({"max_range_m": 0.5}, "min_range_m below max_range_m"),
        ({"field_of_view_rad": 7.0}, "a field of view up to 2 pi"),
    ],
)
def test_an_impossible_sensor_is_refused(values, expected):
    with fault(UsageError, "LiDAR model HDL-64E", expected):
        changed(**values)
