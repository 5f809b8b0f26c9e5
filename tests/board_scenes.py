"""Boards before a wall, seen by a LiDAR and by a camera without noise: edges of both are known exactly."""

from dataclasses import dataclass

import numpy as np

from perception.sensor import HDL_64E
from perception.types import Calibration

WALL_M = 40.0
SIZE_PX = (621, 188)
IMAGE_P_CAM = np.array([[360.0, 0, 310.0, 0], [0, 360.0, 94.0, 0], [0, 0, 1, 0]])
CAM_SE3_VELO = np.array([[0, -1.0, 0, 0], [0, 0, -1.0, -0.08], [1.0, 0, 0, -0.27], [0, 0, 0, 1.0]])
TRUE = Calibration(IMAGE_P_CAM, CAM_SE3_VELO, SIZE_PX, "boards")


@dataclass(frozen=True)
class Boards:
    """Rectangles that face the sensors: x, left and right y, low and high z, all in metres."""

    rows: np.ndarray

    @classmethod
    def drawn(cls, count: int, seed: int) -> "Boards":
        rng = np.random.default_rng(seed)
        x = rng.uniform(6, 25, count)
        y, z = rng.uniform(-0.75, 0.75, count) * x, rng.uniform(-0.12, 0.0, count) * x
        half, height = rng.uniform(0.3, 1.2, count), rng.uniform(0.8, 1.5, count)
        return cls(np.column_stack([x, y - half, y + half, z - height, z]))

    def cast(self, origin, directions):
        """Return the range in x and the board (-1 the wall) that each ray meets."""
        reach, board = np.full(len(directions), WALL_M - origin[0]), np.full(len(directions), -1)
        for number, (x, right, left, low, high) in enumerate(self.rows):
            at = origin + directions * ((x - origin[0]) / directions[:, :1])
            is_met = (at[:, 1] > right) & (at[:, 1] < left) & (at[:, 2] > low) & (at[:, 2] < high)
            is_nearer = is_met & (x - origin[0] < reach)
            reach[is_nearer], board[is_nearer] = x - origin[0], number
        return reach, board

    def scan(self):
        azimuths = np.arange(-0.8, 0.8, HDL_64E.azimuth_step_rad)
        azimuth, elevation = (a.ravel() for a in np.meshgrid(azimuths, HDL_64E.elevations_rad))
        directions = np.column_stack(
            [np.ones_like(azimuth), np.tan(azimuth), np.tan(elevation) / np.cos(azimuth)]
        )
        reach, _ = self.cast(np.zeros(3), directions)
        points = directions * reach[:, None]
        return np.column_stack([points, np.full(len(points), 0.3)]).astype(np.float32)

    def image(self, rng):
        columns, rows = np.meshgrid(*map(np.arange, SIZE_PX))
        pixels = np.stack([columns.ravel(), rows.ravel(), np.ones(columns.size)])
        rays_cam = np.linalg.inv(IMAGE_P_CAM[:, :3]) @ pixels
        directions = (CAM_SE3_VELO[:3, :3].T @ rays_cam).T
        origin = -CAM_SE3_VELO[:3, :3].T @ CAM_SE3_VELO[:3, 3]
        _, board = self.cast(origin, directions)
        greys = np.append(rng.integers(90, 250, len(self.rows)), 50)
        grey = greys[board].reshape(SIZE_PX[::-1]).astype(np.uint8)
        return np.repeat(grey[:, :, None], 3, axis=2)
