"""LiDAR models by name, and their files."""

import json
import re
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from perception.errors import UsageError
from perception.json_text import read_json_text
from perception.sensor.models import HDL_64E, SENSORS
from perception.types import LidarModel

_SUFFIXES = (".yaml", ".yml", ".json")
_FIELDS = tuple(field.name for field in fields(LidarModel))
_ANGLES = tuple(name for name in _FIELDS if name.endswith("_rad"))
_KEYS = ("model", *_FIELDS, *(name.replace("_rad", "_deg") for name in _ANGLES))
_SHAPE = ("elevations_rad", "azimuth_step_rad")  # what a sensor without a model must state


def load_sensor(name: str | Path) -> LidarModel:
    """Return the sensor of that name, in any case, or the one described by that YAML or JSON file.

    A file holds the fields of `LidarModel`, angles in radians or, with _deg in place of _rad, in degrees; elevations in any
    order. With `model` it changes what it states of a known sensor:

        model: OS1-64
        height_m: 2.1

    Raises:
        UsageError: There is no such name or file, or a file does not describe a sensor.
    """
    path = Path(name)
    if path.suffix.lower() in _SUFFIXES and path.is_file():
        return _from_mapping(_read_mapping(path), path)
    return _known(str(name), f"sensor {name}")


def sensor_to_json(sensor: LidarModel) -> str:
    """Return the text that `load_sensor` reads."""
    values = {**vars(sensor), "elevations_rad": sensor.elevations_rad.tolist()}
    return json.dumps(values, indent=1)


def _known(name: str, where: str | Path) -> LidarModel:
    known = {_letters(one): sensor for one, sensor in SENSORS.items()}
    if _letters(name) not in known:
        raise UsageError(
            where,
            expected=f"one of {', '.join(SENSORS)}, or a .yaml or .json file",
            found=f"{name!r}, which is neither",
        )
    return known[_letters(name)]


def _letters(name: str) -> str:
    return re.sub(r"[\W_]", "", name).lower()


def _read_mapping(path: Path) -> Mapping[str, Any]:
    import yaml

    from perception.yaml_text import read_yaml

    try:
        # YAML's numbers lack 1e-3 without a dot, which JSON has.
        read = read_json_text if path.suffix.lower() == ".json" else read_yaml
        values = read(path.read_text())
    except (OSError, ValueError, yaml.YAMLError) as error:
        found = " ".join(str(error).split())
        raise UsageError(path, expected="a LiDAR model in YAML or JSON", found=found) from error
    if not isinstance(values, dict):
        found = f"a {type(values).__name__}"
        raise UsageError(path, expected=f"a mapping of {', '.join(_KEYS)}", found=found)
    return values


def _from_mapping(values: Mapping[str, Any], path: Path) -> LidarModel:
    unknown = [str(key) for key in values if key not in _KEYS]
    if unknown:
        raise UsageError(
            path, expected=f"keys of {', '.join(_KEYS)}", found=", ".join(map(repr, unknown))
        )
    stated = dict(_in_radians(key, value, path) for key, value in values.items() if key != "model")
    if "model" in values:
        return replace(_known(str(values["model"]), path), **stated)
    missing = [name for name in _SHAPE if name not in stated]
    if missing:
        raise UsageError(
            path,
            expected=f"{' and '.join(missing)} (or _deg), or the model that the file changes",
            found=f"only {', '.join(values) or 'an empty file'}",
        )
    return replace(HDL_64E, **{"name": path.stem, "field_of_view_rad": 2 * np.pi, **stated})


def _in_radians(key: str, value: Any, path: Path) -> tuple[str, Any]:  # noqa: ANN401 - of a file
    """Return the name of a field and its value, angles in radians and elevations from high to low."""
    name = key.replace("_deg", "_rad")
    if name == "name":
        return name, str(value)
    if name == "has_rings":
        return name, bool(value)
    try:
        numbers = np.asarray(value, np.float64)
        if not np.isfinite(numbers).all() or (numbers.ndim > 0) != (name == "elevations_rad"):
            raise ValueError(f"{value!r}")
    except (TypeError, ValueError) as error:
        expected = "angles" if name == "elevations_rad" else "a number"
        raise UsageError(path, expected=f"{key} as {expected}", found=repr(value)) from error
    if key.endswith("_deg"):
        numbers = np.radians(numbers)
    return name, np.sort(numbers)[::-1] if name == "elevations_rad" else float(numbers)
