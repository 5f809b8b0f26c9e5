"""LiDAR models: all that an algorithm may know of the sensor."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from perception.errors import UsageError
from perception.types import Float64


@dataclass(frozen=True)
class LidarModel:
    """A spinning multi-beam LiDAR.

    Attributes:
        name: Name given by its maker.
        elevations_rad: (L,) beam elevations above the horizontal, highest first.
        azimuth_step_rad: Angle in rad between two firings of one beam.
        rate_hz: Revolutions per second.
        height_m: Height of the sensor's origin above the road in metres.
        min_range_m: Range of the nearest return in metres.
        max_range_m: Range of the farthest return in metres.
        range_noise_m: Standard deviation of a range in metres.
    """

    name: str
    elevations_rad: Float64
    azimuth_step_rad: float
    rate_hz: float
    height_m: float
    min_range_m: float
    max_range_m: float
    range_noise_m: float

    def __post_init__(self) -> None:
        """Validate the beam elevations, height, rate and azimuth step."""
        elevations = np.asarray(self.elevations_rad, np.float64)
        object.__setattr__(self, "elevations_rad", elevations)
        if elevations.ndim != 1 or len(elevations) < 2 or not (np.diff(elevations) < 0).all():
            raise UsageError(
                f"LiDAR model {self.name}",
                expected="elevations_rad as at least two angles, highest first",
                found=f"an array of shape {elevations.shape} or one that does not fall",
            )
        if not (self.height_m > 0 and self.rate_hz > 0 and self.azimuth_step_rad > 0):
            raise UsageError(
                f"LiDAR model {self.name}",
                expected="a positive height_m, rate_hz and azimuth_step_rad",
                found=f"{self.height_m}, {self.rate_hz}, {self.azimuth_step_rad}",
            )

    @property
    def beams(self) -> int:
        """Number of beams, L."""
        return len(self.elevations_rad)

    @property
    def elevation_step_rad(self) -> float:
        """Mean angle between neighbouring beams, the thesis' Δα (5.2)."""
        return float(self.elevations_rad[0] - self.elevations_rad[-1]) / (self.beams - 1)

    @property
    def columns(self) -> int:
        """Firings of one beam in one turn."""
        return round(2 * np.pi / self.azimuth_step_rad)


def _fan(top_deg: float, bottom_deg: float, beams: int) -> Float64:
    return np.radians(np.linspace(top_deg, bottom_deg, beams))


# Values of the makers' data sheets; heights as mounted on the car of KITTI (thesis 3.1.1).
HDL_64E = LidarModel(
    name="HDL-64E",
    elevations_rad=np.concatenate([_fan(2.0, -8.33, 32), _fan(-8.83, -24.33, 32)]),
    azimuth_step_rad=np.radians(0.1728),
    rate_hz=10.0,
    height_m=1.73,
    min_range_m=0.9,
    max_range_m=120.0,
    range_noise_m=0.02,
)
HDL_32E = LidarModel(
    name="HDL-32E",
    elevations_rad=_fan(10.67, -30.67, 32),
    azimuth_step_rad=np.radians(0.1660),
    rate_hz=10.0,
    height_m=1.73,
    min_range_m=1.0,
    max_range_m=100.0,
    range_noise_m=0.02,
)
VLP_16 = LidarModel(
    name="VLP-16",
    elevations_rad=_fan(15.0, -15.0, 16),
    azimuth_step_rad=np.radians(0.2),
    rate_hz=10.0,
    height_m=1.73,
    min_range_m=0.5,
    max_range_m=100.0,
    range_noise_m=0.02,
)
SENSORS = {sensor.name: sensor for sensor in (HDL_64E, HDL_32E, VLP_16)}


def load_sensor(name: str) -> LidarModel:
    """Return the sensor of that name, or the one described by that JSON file.

    The file holds the fields of `LidarModel`, angles in radians.

    Raises:
        UsageError: no such name or file, or a file that does not describe a sensor.
    """
    if name in SENSORS:
        return SENSORS[name]
    path = Path(name)
    if path.suffix != ".json" or not path.is_file():
        raise UsageError(
            f"sensor {name}",
            expected=f"one of {', '.join(SENSORS)} or a .json file",
            found="neither",
        )
    try:
        fields = json.loads(path.read_text())
        return LidarModel(**{**fields, "elevations_rad": np.asarray(fields["elevations_rad"])})
    except (ValueError, KeyError, TypeError) as error:
        raise UsageError(
            path, expected="a JSON object with the fields of LidarModel", found=str(error)
        ) from error


def sensor_to_json(sensor: LidarModel) -> str:
    """Return the text that `load_sensor` reads."""
    fields = {**vars(sensor), "elevations_rad": sensor.elevations_rad.tolist()}
    return json.dumps(fields, indent=1)
