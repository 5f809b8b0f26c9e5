"""Sensors are known by name in any spelling, or described by a file."""

from pathlib import Path

import numpy as np
import pytest

from perception.errors import UsageError
from perception.sensor import HDL_64E, SENSORS, load_sensor, sensor_to_json
from tests.faults import fault


@pytest.mark.parametrize(
    ("asked", "name"), [("vlp-16", "VLP-16"), ("os1_64", "OS1-64"), ("mid 360", "Mid-360")]
)
def test_names_are_known_in_any_spelling(asked, name):
    assert load_sensor(asked) is SENSORS[name]


def test_an_unknown_name_is_met_with_the_list():
    with fault(UsageError, "sensor OS5-64", "VLS-128, OS0-32", "'OS5-64', which is neither"):
        load_sensor("OS5-64")


def described(folder: Path, text: str, name: str = "mine.yaml"):
    (folder / name).write_text(text)
    return load_sensor(str(folder / name))


def test_a_table_in_degrees_in_any_order(tmp_path):
    sensor = described(
        tmp_path, "elevations_deg: [-15, 3, 15]\nazimuth_step_deg: 0.2\nheight_m: 2.1\n"
    )
    assert np.degrees(sensor.elevations_rad) == pytest.approx([15, 3, -15])
    assert (sensor.name, sensor.columns, sensor.height_m) == ("mine", 1800, 2.1)
    assert sensor.has_rings


def test_a_table_in_radians_in_json(tmp_path):
    text = '{"name": "low", "elevations_rad": [0.1, -0.4], "azimuth_step_rad": 3e-3}'
    sensor = described(tmp_path, text, "low.JSON")
    assert (sensor.name, sensor.azimuth_step_rad) == ("low", 0.003)


def test_a_file_changes_a_known_model(tmp_path):
    sensor = described(tmp_path, "model: os1-64\nheight_m: 2.1\n")
    assert (sensor.name, sensor.height_m) == ("OS1-64", 2.1)
    assert (sensor.elevations_rad == SENSORS["OS1-64"].elevations_rad).all()


@pytest.mark.parametrize("sensor", [HDL_64E, SENSORS["AT128"], SENSORS["Avia"]])
def test_a_written_sensor_reads_the_same(tmp_path, sensor):
    read = described(tmp_path, sensor_to_json(sensor), "sensor.json")
    assert {**vars(read), "elevations_rad": None} == {**vars(sensor), "elevations_rad": None}
    assert (read.elevations_rad == sensor.elevations_rad).all()


@pytest.mark.parametrize(
    ("text", "expected", "found"),
    [
        ("elevations_deg: [1, 0", "a LiDAR model in YAML or JSON", "line 1"),
        ("- 1", "a mapping of model, name, elevations_rad", "a list"),
        ("elevation_deg: [1, 0]", "keys of model, name", "'elevation_deg'"),
        ("height_m: 2", "elevations_rad and azimuth_step_rad (or _deg)", "only height_m"),
        ("elevations_deg: [1, x]\nazimuth_step_deg: 1", "elevations_deg as angles", "[1, 'x']"),
        ("elevations_deg: 3\nazimuth_step_deg: 1", "elevations_deg as angles", "3"),
        ("model: VLP-16\nrate_hz: fast", "rate_hz as a number", "'fast'"),
        ("model: VLP-17", "one of HDL-64E", "'VLP-17', which is neither"),
    ],
)
def test_a_bad_file_is_one_sentence(tmp_path, text, expected, found):
    with fault(UsageError, str(tmp_path / "mine.yaml"), expected, found):
        described(tmp_path, text)
