"""The ground as one plane that pitches with the vehicle: the most frequent angle of a scan (5.3.2)."""

from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks

from perception.tracking.single_object.constant_acceleration import (
    ConstantAcceleration,
    NoiseLevels,
)
from perception.types import Float, Float64

_BIN_RAD = np.radians(0.01)
_STEEPEST_RAD = np.radians(12.0)
# Height of a peak, and over its surroundings, in that of the highest (author's code).
_MIN_PEAK = 0.25


@dataclass(frozen=True)
class PitchFilterConfig:
    """How the angle is found and followed. Angles of noise in degrees, as in the author's code.

    Attributes:
        ahead_m: nearer points are left out: there, centimetres are degrees.
        side_m: points farther to a side are left out.
        around_m: how far below and above the level under the wheels points may lie.
        gate_rad: how far from the expected angle it is looked for, one gate wider with each miss.
        noise: of the filter.
        measured_variance: of one angle.
    """

    ahead_m: float = 4.0  # measured: beyond the vehicle's bonnet and the nearest beams
    side_m: float = 20.0  # author's code, local grid
    around_m: tuple[float, float] = (-0.5, 2.0)  # author's code, local grid
    gate_rad: float = np.radians(0.3)  # author's code
    noise: NoiseLevels = field(  # author's code, deg²
        default_factory=lambda: NoiseLevels(process=5.0, first=15.0)
    )
    measured_variance: float = 0.5  # author's code, deg²


@dataclass(frozen=True)
class PitchedPlane:
    """A ground plane through the point under the sensor; a `GroundModel`.

    Attributes:
        pitch_rad: by which it rises ahead.
        sensor_height_m: over the ground.
    """

    pitch_rad: float
    sensor_height_m: float

    def height_m(self, xy_m: Float) -> Float64:
        """Return (N,) the z of the ground at (N, 2) positions."""
        return np.asarray(np.tan(self.pitch_rad) * xy_m[:, 0] - self.sensor_height_m, np.float64)

    def distance_m(self, points_velo: Float) -> Float64:
        """Return (N,) signed distances of (N, 3+) points along the ground's normal, up positive."""
        raised_m = points_velo[:, 2] + self.sensor_height_m
        return np.asarray(
            np.cos(self.pitch_rad) * raised_m - np.sin(self.pitch_rad) * points_velo[:, 0],
            np.float64,
        )


class PitchFilter:
    """Follows the pitch of the ground from scan to scan."""

    def __init__(self, sensor_height_m: float, config: PitchFilterConfig | None = None) -> None:
        self._sensor_height_m = sensor_height_m
        self._config = config or PitchFilterConfig()
        self._angle_deg: ConstantAcceleration | None = None
        self._missed = 0

    def update(self, points_velo: Float, elapsed_s: float) -> PitchedPlane:
        """Find the ground of a scan that follows the last one after a while; at first, anywhere."""
        config = self._config
        angles_rad = elevation_angles(points_velo, self._sensor_height_m, config)
        if self._angle_deg is None:
            self._init_angle(dominant_angle(angles_rad, (-_STEEPEST_RAD, _STEEPEST_RAD)))
        else:
            self._angle_deg = self._angle_deg.predicted(elapsed_s, config.noise)
            expected_rad = float(np.radians(self._angle_deg.position[0]))
            reach_rad = config.gate_rad * (1 + self._missed)
            self._correct(
                dominant_angle(angles_rad, (expected_rad - reach_rad, expected_rad + reach_rad))
            )
        pitch_deg = self._angle_deg.position[0] if self._angle_deg else 0.0
        return PitchedPlane(float(np.radians(pitch_deg)), self._sensor_height_m)

    def _init_angle(self, found_rad: float | None) -> None:
        if found_rad is not None:
            self._angle_deg = ConstantAcceleration.at_rest(
                np.degrees([found_rad]), self._config.noise
            )

    def _correct(self, found_rad: float | None) -> None:
        """Take in an angle; without one the prediction stands."""
        self._missed = self._missed + 1 if found_rad is None else 0
        if found_rad is not None and self._angle_deg is not None:
            self._angle_deg = self._angle_deg.corrected(
                np.degrees([[found_rad]]), np.array([self._config.measured_variance])
            )


def elevation_angles(
    points_velo: Float, sensor_height_m: float, config: PitchFilterConfig
) -> Float:
    """Return the angle of each point ahead over the level under the wheels (5.10).

    The lines go out from the ground under the sensor: from there all points of a plane are at one angle.
    """
    x, y = points_velo[:, 0], points_velo[:, 1]
    raised_m = points_velo[:, 2] + sensor_height_m
    lowest_m, highest_m = config.around_m
    chosen = (x > config.ahead_m) & (np.abs(y) < np.minimum(x, config.side_m))
    chosen &= (raised_m > lowest_m) & (raised_m < highest_m)
    return np.asarray(np.arctan2(raised_m[chosen], x[chosen]))


def dominant_angle(angles_rad: Float, within_rad: tuple[float, float]) -> float | None:
    """Return the highest peak of the angles' density (5.10) within an interval.

    The density is that of a Gaussian kernel, over bins of a hundredth of a degree.

    Returns:
        None where there is no peak, as where there are no angles or the density rises to a side only.
    """
    angles_rad = angles_rad[np.abs(angles_rad) < _STEEPEST_RAD]
    if len(angles_rad) == 0:
        return None
    bins = round(2 * _STEEPEST_RAD / _BIN_RAD)
    rows = ((angles_rad + _STEEPEST_RAD) / _BIN_RAD).astype(np.int32)
    histogram = np.bincount(rows, minlength=bins).astype(np.float64)
    width_bins = max(bandwidth(angles_rad) / _BIN_RAD, 1.0)
    density = gaussian_filter1d(histogram, width_bins, mode="constant")
    least = _MIN_PEAK * density.max()
    peaks, _ = find_peaks(density, height=least, prominence=least)
    middles_rad = (peaks + 0.5) * _BIN_RAD - _STEEPEST_RAD
    within = (middles_rad >= within_rad[0]) & (middles_rad <= within_rad[1])
    if not within.any():
        return None
    return float(middles_rad[within][density[peaks[within]].argmax()])


def bandwidth(angles_rad: Float) -> float:
    """Return the kernel's width that suits a normal distribution, its deviation taken from the median."""
    deviation = np.median(np.abs(angles_rad - np.median(angles_rad))) / 0.6745
    return float(deviation * (4 / (3 * len(angles_rad))) ** 0.2)
