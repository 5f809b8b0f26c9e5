"""Local short-term map: mean heights of the last scans around the vehicle (Algorithm 4).

The thesis transforms every stored grid into the vehicle's frame at each scan. Here each grid is resampled once into
cells that are fixed to the earth, and only the finished map is transformed, so the length of the queue costs memory
and no time.
"""

import cv2
import numpy as np

from perception.datmo.cell_grid import CellGrid
from perception.datmo.cell_history import CellHistory
from perception.datmo.config import MotionGridConfig
from perception.datmo.elevation import ElevationGrid
from perception.geometry.se3 import inverse
from perception.types import Float32, Float64, Int


class ShortTermMap:
    """Maps the static world around the vehicle, in the frame of the newest scan."""

    def __init__(self, cells: CellGrid, config: MotionGridConfig) -> None:
        self._cells = cells
        # Holds the grid at any heading, from its middle to its corners.
        self._half_cells = int(np.ceil(np.hypot(*cells.shape) / 2)) + 1
        self._history = CellHistory(
            2 * self._half_cells, config.scans, config.max_observations, config.min_observations
        )
        self.clear()

    @property
    def scans(self) -> int:
        """Number of scans in the queue."""
        return self._history.scans

    def clear(self) -> None:
        """Forget all scans; the cells of the plane will be those of the next scan's grid."""
        self._history.clear()
        self._plane_T_cells = np.eye(3)
        self._world_SE3_before: Float64 | None = None

    def update(self, elevation: ElevationGrid, world_SE3_velo: Float64) -> Float32:
        """Add a scan's grid, and return the (X, Y) map around the vehicle (Algorithm 4)."""
        self._move_with_vehicle(world_SE3_velo)
        low = np.floor(self._plane_T_cells @ (*np.array(self._cells.shape) / 2, 1))[:2]
        low = low.astype(np.int64) - self._half_cells
        self._history.move_to(low)
        window_T_cells = _shift(-low) @ self._plane_T_cells
        self._observe(elevation, window_T_cells)
        return _resample(self._history.mean_m(), window_T_cells, self._cells.shape, 0.0)

    def _move_with_vehicle(self, world_SE3_velo: Float64) -> None:
        """Add the vehicle's last motion, within the vehicle's own plane on any slope."""
        if self._world_SE3_before is not None:
            before_SE3_velo = inverse(self._world_SE3_before) @ world_SE3_velo
            cells_T_velo = self._cells.cells_T_velo
            motion = cells_T_velo @ planar(before_SE3_velo) @ np.linalg.inv(cells_T_velo)
            self._plane_T_cells = self._plane_T_cells @ motion
        self._world_SE3_before = world_SE3_velo

    def _observe(self, elevation: ElevationGrid, window_T_cells: Float64) -> None:
        seen_m = np.where(elevation.is_observed, elevation.height_m, np.float32(np.nan))
        cells_T_window = np.asarray(np.linalg.inv(window_T_cells), np.float64)
        shape = (self._history.size, self._history.size)
        self._history.observe(_resample(seen_m, cells_T_window, shape, np.nan))


def planar(dst_SE3_src: Float64) -> Float64:
    """Return the (3, 3) rotation and translation within the plane of x and y."""
    yaw_rad = np.arctan2(dst_SE3_src[1, 0], dst_SE3_src[0, 0])
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    x_m, y_m = dst_SE3_src[:2, 3]
    return np.array([[cos, -sin, x_m], [sin, cos, y_m], [0, 0, 1]], np.float64)


def _shift(cells: Float64 | Int) -> Float64:
    shift = np.eye(3)
    shift[:2, 2] = cells
    return shift


def _resample(
    grid: Float32, source_T_target: Float64, shape: tuple[int, int], outside: float
) -> Float32:
    """Return a grid of another shape: each cell takes the value of the cell that its middle lies in."""
    # From cell coordinates to OpenCV's: column before row, and whole numbers in the middles.
    pixels = (_shift(np.full(2, -0.5)) @ source_T_target @ _shift(np.full(2, 0.5)))[[1, 0]]
    return np.asarray(
        cv2.warpAffine(
            grid,
            pixels[:, [1, 0, 2]],
            shape[::-1],
            flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=outside,
        )
    )
