"""Sweeps: the points of both LiDARs within a turn, moved to one time, in the frame of the vehicle."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from data.argoverse2.tables import read_feather
from data.kitti.sensor_files import SKIP_ADVICE
from perception.errors import ScanError
from perception.sensor import LidarModel
from perception.types import Float32, Float64, Int

_COLUMNS = ("x", "y", "z", "intensity", "laser_number")
_FULL_SCALE = np.float32(255)
_BEAM_FROM_M = 3.0  # nearer, the lower LiDAR sees the world from another place than the upper one
_MIN_RETURNS = 20  # of a beam whose elevation is measured
_SAME_BEAM_RAD = np.radians(0.001)  # a model needs angles that fall


@dataclass(frozen=True)
class Sweep:
    """N points of a sweep.

    Attributes:
        points_velo: (N, 4) at the place of the upper LiDAR, with the axes of the vehicle; reflectance 0..1.
        lasers: (N,) number of the beam, 0 to 63.
    """

    points_velo: Float32
    lasers: Int


def read_sweep(path: Path, ego_SE3_velo: Float64) -> Sweep:
    """Read a sweep; `Frame` validates its points.

    Raises:
        ScanError: The file is missing or damaged.
    """
    table = read_feather(path, _COLUMNS, ScanError, f"a sweep ({SKIP_ADVICE})")
    columns = [np.asarray(table[name], np.float32) for name in _COLUMNS[:3]]
    points_velo = np.stack([*columns, np.asarray(table["intensity"], np.float32)], axis=1)
    points_velo[:, :3] -= ego_SE3_velo[:3, 3].astype(np.float32)
    points_velo[:, 3] /= _FULL_SCALE
    return Sweep(points_velo, np.asarray(table["laser_number"], np.int64))


def measure_sensor(sweep: Sweep, height_m: float) -> LidarModel:
    """Return the two LiDARs as one, with the beams that a sweep shows.

    The lower one hangs upside down, 0.1 m below the upper. All beams are told as from the place of the upper one.

    Args:
        sweep: Sweep with returns of at least two beams.
        height_m: Height of the upper LiDAR over the road in metres.
    """
    x, y, z = sweep.points_velo[:, :3].T.astype(np.float64)
    across_m = np.hypot(x, y)
    is_far = across_m > _BEAM_FROM_M
    elevations_rad, lasers = np.arctan2(z, across_m)[is_far], sweep.lasers[is_far]
    numbers, counts = np.unique(lasers, return_counts=True)
    beams = [np.median(elevations_rad[lasers == one]) for one in numbers[counts >= _MIN_RETURNS]]
    falling_rad = np.sort(np.array(beams, np.float64))[::-1]
    # Some beams of the two LiDARs have the same elevation.
    is_distinct = np.diff(falling_rad, prepend=np.inf) < -_SAME_BEAM_RAD
    return LidarModel(
        name="two VLP-32C",
        elevations_rad=falling_rad[is_distinct],
        azimuth_step_rad=np.radians(0.2),
        rate_hz=10.0,
        height_m=height_m,
        min_range_m=1.0,
        max_range_m=200.0,
        range_noise_m=0.03,
    )
