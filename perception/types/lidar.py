"""All that an algorithm may know of the LiDAR."""

from dataclasses import dataclass

import numpy as np

from perception.errors import UsageError
from perception.types.table import Float64

_DENSE_BEAMS = 64


@dataclass(frozen=True)
class LidarModel:
    """A multi-beam LiDAR.

    A LiDAR whose beams follow no rings is described by rows and columns that are as far apart as its returns are in one
    scan: all range images are made by angle.

    Attributes:
        name: Name given by its maker.
        elevations_rad: (L,) beam elevations above the horizontal, highest first.
        azimuth_step_rad: Angle in rad between two firings of one beam.
        rate_hz: Revolutions or scans per second.
        height_m: Height of the sensor's origin above the road in metres.
        min_range_m: Range of the nearest return in metres.
        max_range_m: Range of the farthest return in metres.
        range_noise_m: Standard deviation of a range in metres.
        field_of_view_rad: Angle that the beams sweep around straight ahead; a full turn where the head spins.
        has_rings: Whether every beam keeps its elevation.
    """

    name: str
    elevations_rad: Float64
    azimuth_step_rad: float
    rate_hz: float
    height_m: float
    min_range_m: float
    max_range_m: float
    range_noise_m: float
    field_of_view_rad: float = 2 * np.pi
    has_rings: bool = True

    def __post_init__(self) -> None:
        """Validate the beam elevations, height, rate, azimuth step, ranges and field of view."""
        elevations = np.ascontiguousarray(self.elevations_rad, np.float64)
        object.__setattr__(self, "elevations_rad", elevations)
        if elevations.ndim != 1 or len(elevations) < 2 or not (np.diff(elevations) < 0).all():
            raise UsageError(
                f"LiDAR model {self.name}",
                expected="elevations_rad as at least two angles, highest first",
                found=f"an array of shape {elevations.shape} or one that does not fall",
            )
        if not (np.abs(elevations) <= np.pi / 2).all():
            raise UsageError(
                f"LiDAR model {self.name}",
                expected="elevations_rad from -pi/2 to pi/2",
                found=f"{elevations[-1]:g} to {elevations[0]:g}",
                advice="name the key elevations_deg where they are in degrees",
            )
        if not (self.height_m > 0 and self.rate_hz > 0 and self.azimuth_step_rad > 0):
            raise UsageError(
                f"LiDAR model {self.name}",
                expected="a positive height_m, rate_hz and azimuth_step_rad",
                found=f"{self.height_m}, {self.rate_hz}, {self.azimuth_step_rad}",
            )
        is_whole = 0 <= self.min_range_m < self.max_range_m and self.range_noise_m >= 0
        if not (is_whole and 0 < self.field_of_view_rad <= 2 * np.pi + 1e-9):
            raise UsageError(
                f"LiDAR model {self.name}",
                expected="min_range_m below max_range_m, range_noise_m of 0 or more, and a field of view up to 2 pi",
                found=f"{self.min_range_m}, {self.max_range_m}, {self.range_noise_m}, {self.field_of_view_rad}",
            )

    @property
    def beams(self) -> int:
        """Number of beams, L."""
        return len(self.elevations_rad)

    @property
    def is_dense(self) -> bool:
        """Whether it has as many beams as the HDL-64E, by which the thesis and the networks of dm and rm were made."""
        return self.beams >= _DENSE_BEAMS

    @property
    def elevation_step_rad(self) -> float:
        """Mean angle between neighbouring beams, the thesis' Δα (5.2)."""
        return float(self.elevations_rad[0] - self.elevations_rad[-1]) / (self.beams - 1)

    @property
    def columns(self) -> int:
        """Firings of one beam in a full turn."""
        return round(2 * np.pi / self.azimuth_step_rad)
