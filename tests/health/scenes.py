"""Frames made by hand: a street as beams see it, and an image of edges and noise that moves."""

import numpy as np

from perception.geometry.se3 import from_euler
from perception.sensor import LidarModel
from perception.types import Frame

SENSOR = LidarModel(
    "of the test",
    elevations_rad=np.radians(np.linspace(6.0, -24.0, 16)),
    azimuth_step_rad=np.radians(0.5),
    rate_hz=10.0,
    height_m=1.7,
    min_range_m=1.0,
    max_range_m=100.0,
    range_noise_m=0.02,
)
WALL_M = 30.0
SPEED_M_S = 10.0


def scan(index: int) -> np.ndarray:
    """Return the returns of a road and of a round wall, with noise."""
    rng = np.random.default_rng(index)
    elevations, azimuths = np.meshgrid(
        SENSOR.elevations_rad, np.arange(-180.0, 180.0, 0.5) * np.pi / 180, indexing="ij"
    )
    ground_m = np.where(
        elevations < 0, SENSOR.height_m / np.maximum(-np.sin(elevations), 1e-6), 1e3
    )
    ranges_m = np.minimum(ground_m, WALL_M / np.cos(elevations))
    ranges_m = ranges_m + 0.02 * rng.standard_normal(ranges_m.shape)
    across_m = ranges_m * np.cos(elevations)
    points = np.stack(
        [
            across_m * np.cos(azimuths),
            across_m * np.sin(azimuths),
            ranges_m * np.sin(elevations),
            np.full_like(ranges_m, 0.3),
        ],
        axis=-1,
    )
    return points.reshape(-1, 4).astype(np.float32)


def image(index: int) -> np.ndarray:
    """Return an image of vertical edges that moves by five pixels a frame, with noise."""
    rng = np.random.default_rng(index)
    columns = (np.arange(1242) + 5 * index) // 3
    levels = np.random.default_rng(0).integers(30, 220, 4096)[columns]
    noisy = levels[None, :, None] + 3 * rng.standard_normal((192, 1242, 3))
    return np.clip(noisy, 0, 255).astype(np.uint8)


def pose(index: int) -> np.ndarray:
    """Return the pose of a vehicle that drives straight on."""
    return from_euler(0, 0, 0, np.array([0.1 * SPEED_M_S * index, 0.0, 0.0]))


def frames(count: int) -> list[Frame]:
    """Return the frames of a drive without fault."""
    return [
        Frame(i, 0.1 * i, scan(i), image=image(i), world_SE3_velo=pose(i)) for i in range(count)
    ]
