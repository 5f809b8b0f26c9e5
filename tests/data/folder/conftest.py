"""Folders of scans of a bare road with walls, as a LiDAR of few beams sees them while it drives along."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from perception.sensor import HDL_32E, LidarModel
from tests.rays import unit_rays

STEP_M = 1.0
_HALF_WIDTH_M, _WALL_M = 8.0, 6.0


def road_scan(
    index: int,
    sensor: LidarModel = HDL_32E,
    tilt_deg: tuple[float, float] = (0.0, 0.0),
    columns: int = 720,
) -> np.ndarray:
    """Return (N, 4) points of a road between two walls with posts, `index` steps along it.

    Args:
        index: Number of steps driven.
        sensor: LiDAR model with its height.
        tilt_deg: Roll and pitch of the sensor.
        columns: Number of firings of one turn.
    """
    azimuth = np.linspace(-np.pi, np.pi, columns, endpoint=False)
    rays = unit_rays(azimuth, sensor.elevations_rad)
    turn = Rotation.from_euler("ZYX", (0, tilt_deg[1], tilt_deg[0]), degrees=True).as_matrix()
    level = rays @ turn.T
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = np.where(level[:, 2] < 0, -sensor.height_m / level[:, 2], np.inf)
        # Walls with piers of another depth every four metres, at which a motion is seen.
        for side in (1, -1):
            for wall_m in (_HALF_WIDTH_M, _HALF_WIDTH_M - 1.5):
                away_m = side * wall_m / level[:, 1]
                along_m = away_m * level[:, 0] + index * STEP_M
                is_pier = (along_m // 2 + side) % 3 == 0
                is_there = (away_m > 0) & (sensor.height_m + away_m * level[:, 2] < _WALL_M)
                is_there &= is_pier | (wall_m == _HALF_WIDTH_M)
                range_m = np.where(is_there, np.minimum(range_m, away_m), range_m)
    kept = range_m < 60
    points = np.zeros((int(kept.sum()), 4), np.float32)
    points[:, :3] = rays[kept] * range_m[kept, None]
    points[:, 3] = (np.arange(len(points)) % 256) / 255
    return points


@pytest.fixture
def write_folder(tmp_path: Path) -> Callable[..., Path]:
    """Return a function that writes scans into a folder as .npy files."""

    def write(scans: list[np.ndarray], name: str = "drive") -> Path:
        folder = tmp_path / name
        (folder / "lidar").mkdir(parents=True)
        for index, points in enumerate(scans):
            np.save(folder / "lidar" / f"{index:06d}.npy", points)
        return folder

    return write
