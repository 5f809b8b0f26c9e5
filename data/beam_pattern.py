"""Beams of the sensor that took a scan, compared with those of the LiDAR model.

A revolution holds few elevations and many azimuths. Within a narrow sector, sorted elevations therefore rise in steps
from beam to beam, whatever the beams hit.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np

from data.plausibility import Anomaly
from perception.sensor import SENSORS, LidarModel
from perception.types import Bool, Float32, Float64, Frame

_SECTOR_RAD = np.radians(0.5)  # two or three firings
_EVERY_SECTOR = 4  # a quarter of the sectors is plenty
_SAME_BEAM_RAD = np.radians(0.08)  # real models have 0.1 degrees and more between beams
_NEAREST_M = 2.0  # the beams of one sensor do not start from one point
_MIN_STEPS = 200  # fewer say nothing
# Calibrated beams lie up to 2 degrees from the data sheet's, and a fifth closer together (KITTI's HDL-64E, measured).
_RANGE_TOLERANCE_RAD = np.radians(2.5)
_SPACING_TOLERANCE = 1.25
_MAX_LINES_RATIO = 1.25  # firings of one beam may differ
_MAX_SHARE_OUTSIDE = 0.1
_VIEW_QUANTILES = (0.005, 0.995)
_MAX_NAMED = 3  # of the sensors that fit


@dataclass(frozen=True)
class BeamPattern:
    """Elevations of the returns of a scan.

    Attributes:
        elevations_rad: (N,) elevations of the returns in evenly distributed sectors.
        spacing_rad: Median step from one elevation to the next within a sector.
        lines: Number of elevations in the sectors that have the most.
    """

    elevations_rad: Float64
    spacing_rad: float
    lines: int

    @classmethod
    def of(cls, points_velo: Float32) -> Self | None:
        """Measure the beams of (N, 4) points; None where there are too few returns."""
        x, y, z = points_velo[:, :3].T.astype(np.float64)
        across_m = np.hypot(x, y)
        sectors = np.floor(np.arctan2(y, x) / _SECTOR_RAD).astype(np.int64)
        used = np.flatnonzero((across_m > _NEAREST_M) & (sectors % _EVERY_SECTOR == 0))
        elevations_rad, sectors = np.arctan2(z[used], across_m[used]), sectors[used]
        order = np.lexsort((elevations_rad, sectors))
        steps_rad, of_sector = np.diff(elevations_rad[order]), sectors[order]
        is_step = (of_sector[1:] == of_sector[:-1]) & (steps_rad > _SAME_BEAM_RAD)
        if is_step.sum() < _MIN_STEPS:
            return None
        counts = np.unique(of_sector[1:][is_step], return_counts=True)[1]
        lines = 1 + int(np.quantile(counts, 0.95))
        return cls(elevations_rad, float(np.median(steps_rad[is_step])), lines)

    def fits(self, sensor: LidarModel) -> bool:
        """Return whether the number, the range and the spacing of the elevations are those of a sensor."""
        # Some sensors have their beams closer together at the horizon than elsewhere.
        low_rad, high_rad = np.quantile(-np.diff(sensor.elevations_rad), (0.25, 0.75))
        return bool(
            low_rad / _SPACING_TOLERANCE <= self.spacing_rad <= high_rad * _SPACING_TOLERANCE
            and self.lines <= _MAX_LINES_RATIO * sensor.beams
            and self._is_outside(sensor).mean() <= _MAX_SHARE_OUTSIDE
        )

    def fitting_sensors(self) -> list[str]:
        """Return the names of the known sensors that fit, the most similar first."""
        fitting = [known for known in SENSORS.values() if known.has_rings and self.fits(known)]
        return [known.name for known in sorted(fitting, key=self._difference)]

    def _difference(self, sensor: LidarModel) -> float:
        """Return how much range and number of the elevations differ from those of a sensor, as a share of them."""
        low_rad, high_rad = np.quantile(self.elevations_rad, _VIEW_QUANTILES)
        top_rad, bottom_rad = sensor.elevations_rad[0], sensor.elevations_rad[-1]
        of_range = (abs(high_rad - top_rad) + abs(low_rad - bottom_rad)) / (top_rad - bottom_rad)
        return float(of_range + abs(self.lines / sensor.beams - 1))

    def _is_outside(self, sensor: LidarModel) -> Bool:
        """Return (N,) which returns no beam of a sensor can have made."""
        top_rad, bottom_rad = sensor.elevations_rad[0], sensor.elevations_rad[-1]
        return np.asarray(
            (self.elevations_rad > top_rad + _RANGE_TOLERANCE_RAD)
            | (self.elevations_rad < bottom_rad - _RANGE_TOLERANCE_RAD)
        )

    def __str__(self) -> str:
        """Return the number, the range and the spacing in degrees."""
        low_deg, high_deg = np.degrees(np.quantile(self.elevations_rad, _VIEW_QUANTILES))
        spacing_deg = np.degrees(self.spacing_rad)
        return f"{self.lines} from {low_deg:.1f} to {high_deg:.1f} degrees, {spacing_deg:.2f} apart"


def beam_anomalies(frame: Frame, sensor: LidarModel) -> Iterator[Anomaly]:
    """Find a scan whose beams are not those of the LiDAR model, and name the sensor that fits."""
    pattern = BeamPattern.of(frame.points_velo) if sensor.has_rings else None
    if pattern is None or pattern.fits(sensor):
        return
    low_deg, high_deg = np.degrees((sensor.elevations_rad[-1], sensor.elevations_rad[0]))
    spacing_deg = np.degrees(sensor.elevation_step_rad)
    fitting = pattern.fitting_sensors()
    advice = (
        f"pass --sensor {' or '.join(fitting[:_MAX_NAMED])}, which fits"
        if fitting
        else "describe the sensor in a .yaml file for --sensor, as no known model fits"
    )
    yield Anomaly(
        "beams of another sensor",
        f"{frame.source}: expected {sensor.beams} beams from {low_deg:.1f} to {high_deg:.1f} degrees, "
        f"{spacing_deg:.2f} apart, as {sensor.name} has them, found {pattern}; {advice}",
    )
