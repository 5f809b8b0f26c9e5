"""Ground as one plane that pitches with the vehicle: the most frequent angle of a scan's points (5.3.2)."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks

from perception.tracking.single_object.config import PitchGroundConfig
from perception.tracking.single_object.point_motion import ConstantAcceleration
from perception.types import Float, Float64


@dataclass(frozen=True)
class PitchedPlane:
    """Ground plane through the point below the sensor; a `GroundModel`.

    Attributes:
        pitch_rad: Angle by which the plane rises ahead.
        sensor_height_m: Height of the sensor above the ground.
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
    """Tracks the pitch of the ground from scan to scan.

    Attributes:
        gate_rad: Interval in which the pitch of the last scan was searched.
    """

    def __init__(self, sensor_height_m: float, config: PitchGroundConfig | None = None) -> None:
        self._sensor_height_m = sensor_height_m
        self._config = config or PitchGroundConfig()
        self.gate_rad = (-np.inf, np.inf)
        self._angle_deg: ConstantAcceleration | None = None
        self._missed = 0

    def update(self, points_velo: Float, elapsed_s: float) -> PitchedPlane:
        """Return the ground of the next scan; in the first scan the pitch may be any.

        Args:
            points_velo: (N, 3+) points of the scan.
            elapsed_s: Time since the last scan.
        """
        config = self._config
        angles_rad = elevation_angles(points_velo, self._sensor_height_m, config)
        if self._angle_deg is None:
            self._init(dominant_angle(angles_rad, self.gate_rad, config))
        else:
            self._angle_deg = self._angle_deg.predicted(elapsed_s, config.noise.process)
            expected_rad = float(np.radians(self._angle_deg.position[0]))
            reach_rad = config.gate_rad * (1 + self._missed)
            self.gate_rad = (expected_rad - reach_rad, expected_rad + reach_rad)
            self._correct(dominant_angle(angles_rad, self.gate_rad, config))
        pitch_deg = self._angle_deg.position[0] if self._angle_deg else 0.0
        return PitchedPlane(float(np.radians(pitch_deg)), self._sensor_height_m)

    def _init(self, found_rad: float | None) -> None:
        if found_rad is not None:
            self._angle_deg = ConstantAcceleration.at_rest(
                np.degrees([found_rad]), self._config.noise.initial
            )

    def _correct(self, found_rad: float | None) -> None:
        """Correct the pitch by a measured angle; without one the prediction is kept."""
        self._missed = self._missed + 1 if found_rad is None else 0
        if found_rad is not None and self._angle_deg is not None:
            self._angle_deg = self._angle_deg.corrected(
                np.degrees([[found_rad]]), np.array([self._config.noise.measurement])
            )


def elevation_angles(
    points_velo: Float, sensor_height_m: float, config: PitchGroundConfig
) -> Float:
    """Return the angle of each point ahead above the level under the wheels (5.10).

    The lines start at the ground below the sensor: from there all points of a plane are at one angle.
    """
    x, raised_m = side_view(points_velo, sensor_height_m, config).T
    return np.asarray(np.arctan2(raised_m, x))


def side_view(points_velo: Float, sensor_height_m: float, config: PitchGroundConfig) -> Float:
    """Return (K, 2) distance ahead and height above the level under the wheels of the points that are used."""
    x, y = points_velo[:, 0], points_velo[:, 1]
    raised_m = points_velo[:, 2] + sensor_height_m
    min_height_m, max_height_m = config.height_range_m
    chosen = (x > config.min_ahead_m) & (np.abs(y) < np.minimum(x, config.max_side_m))
    chosen &= (raised_m > min_height_m) & (raised_m < max_height_m)
    return np.stack([x[chosen], raised_m[chosen]], axis=1)


def dominant_angle(
    angles_rad: Float, within_rad: tuple[float, float], config: PitchGroundConfig
) -> float | None:
    """Return the highest peak of the angles' density (5.10) within an interval.

    Returns:
        None without a peak, as without angles or where the density rises towards one side.
    """
    middles_rad, density = angle_density(angles_rad, config)
    min_peak = config.min_peak * density.max()
    peaks, _ = find_peaks(density, height=min_peak, prominence=min_peak)
    is_within = (middles_rad[peaks] >= within_rad[0]) & (middles_rad[peaks] <= within_rad[1])
    peaks = peaks[is_within]
    return float(middles_rad[peaks[density[peaks].argmax()]]) if len(peaks) else None


def angle_density(angles_rad: Float, config: PitchGroundConfig) -> tuple[Float64, Float64]:
    """Return the density of the angles (5.10).

    Returns:
        (B,) the angles in the middle of each bin, and (B,) the density there per radian: the points of each bin,
        smoothed by a Gaussian kernel.
    """
    # Double precision, also for angles of single precision.
    steepest_rad, bin_rad = np.float64(config.max_pitch_rad), np.float64(config.bin_rad)
    bins = round(2 * steepest_rad / bin_rad)
    middles_rad = (np.arange(bins) + 0.5) * bin_rad - steepest_rad
    angles_rad = angles_rad[np.abs(angles_rad) < steepest_rad]
    if len(angles_rad) == 0:
        return middles_rad, np.zeros(bins)
    rows = ((angles_rad + steepest_rad) / bin_rad).astype(np.int32)
    histogram = np.bincount(rows, minlength=bins).astype(np.float64)
    width_bins = max(bandwidth(angles_rad) / bin_rad, 1.0)
    smoothed = gaussian_filter1d(histogram, width_bins, mode="constant")
    return middles_rad, smoothed / (len(angles_rad) * bin_rad)


def bandwidth(angles_rad: Float) -> float:
    """Return the kernel's width that suits a normal distribution, its deviation taken from the median."""
    deviation = np.median(np.abs(angles_rad - np.median(angles_rad))) / 0.6745
    return float(deviation * (4 / (3 * len(angles_rad))) ** 0.2)
