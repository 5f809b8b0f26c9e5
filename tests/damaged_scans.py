"""Scans with every kind of damage, of a VLP-16 on a road between walls."""

from collections.abc import Callable

import numpy as np

from perception.sensor import VLP_16
from perception.types import Boxes3D, Calibration, Float32, Frame, Int

CALIBRATION = Calibration(
    image_P_cam=np.array([[72.0, 0, 61, 0], [0, 72, 17, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0, -1, 0, 0.0], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]]),
    image_size_px=(124, 38),
)
CAR = Boxes3D(np.array([[10.0, 2.0, -1.73]]), np.array([[4.0, 1.8, 1.5]]), np.zeros(1))


def road_scan() -> Float32:
    """Return (N, 4) points of a VLP-16 on a flat road with a wall on each side and a car ahead."""
    elevation, azimuth = np.meshgrid(VLP_16.elevations_rad, np.arange(0, 2 * np.pi, 0.02))
    to_road_m = VLP_16.height_m / np.maximum(-np.tan(elevation), 1e-3)
    to_wall_m = 12 / np.maximum(np.abs(np.sin(azimuth)), 0.2)
    across_m = np.minimum(to_road_m, to_wall_m)
    is_car = (np.abs(azimuth - 0.2) < 0.08) & (np.abs(elevation) < 0.15)
    across_m[is_car] = np.minimum(across_m, 8.0)[is_car]
    x, y, z = (across_m * one for one in (np.cos(azimuth), np.sin(azimuth), np.tan(elevation)))
    return np.stack([x, y, z, 0 * x + 0.3], axis=-1, dtype=np.float32).reshape(-1, 4)


def _assign(rows: slice | Int, columns: slice | int, value: float) -> Callable[[Float32], Float32]:
    def damage(points: Float32) -> Float32:
        points[rows, columns] = value
        return points

    return damage


_RANDOM_ROWS = np.random.default_rng(0).permutation(len(road_scan()))[: len(road_scan()) // 3]
_XYZ, _ALL = slice(0, 3), slice(None)
DAMAGES: dict[str, Callable[[Float32], Float32]] = {
    "none": lambda points: points,
    "empty": lambda points: points[:0],
    "one point": lambda points: points[:1],
    "three points": lambda points: points[:3],
    "zeros": _assign(_ALL, _ALL, 0),
    "one place": lambda points: np.tile(np.float32([10, 1, -1, 0.5]), (len(points), 1)),
    "behind": lambda points: points[points[:, 0] < 0],
    "beyond the area": lambda points: points * np.float32([60, 60, 60, 1]),
    "on the vehicle": lambda points: points * np.float32([0.01, 0.01, 0.01, 1]),
    "one line": lambda points: points * np.float32([1, 0, 0, 1]),
    "one plane": _assign(_ALL, 2, -1.73),
    "one beam": lambda points: points[3 :: VLP_16.beams],
    "above the horizon": lambda points: points[points[:, 2] > 0],
    "NaN points": _assign(_RANDOM_ROWS, _XYZ, np.nan),
    "NaN z": _assign(_ALL, 2, np.nan),
    "NaN reflectance": _assign(_RANDOM_ROWS, 3, np.nan),
    "infinite": _assign(_RANDOM_ROWS, 0, -np.inf),
    "huge": _assign(_RANDOM_ROWS, _XYZ, 1e30),
    "nearly 10 km": _assign(_RANDOM_ROWS, _XYZ, -9_999),
    "denormal": _assign(_ALL, _XYZ, 1e-42),
    "no reflectance": _assign(_ALL, 3, 0),
}


# What holds no measurement is refused; everything else gives a result.
REFUSED = ("empty", "zeros", "NaN z")


def frame_of(index: int, damage: str = "none") -> Frame:
    """Return a frame whose scan is damaged, with an image."""
    rng = np.random.default_rng(index)
    with np.errstate(invalid="ignore"):
        points_velo = DAMAGES[damage](road_scan())
    image = rng.integers(0, 255, (38, 124, 3)).astype(np.uint8)
    return Frame(index, index / 10, points_velo, image, calibration=CALIBRATION)
