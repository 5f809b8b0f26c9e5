"""Local short-term map: mean heights of the last scans around the vehicle (Algorithm 4).

The thesis transforms every stored grid into the vehicle's frame at each scan. Here each grid is resampled once into
cells that are fixed to the earth, and only the finished map is transformed, so the length of the queue costs memory
and no time.
"""

from collections import deque
from dataclasses import dataclass

import cv2
import numpy as np

from perception.datmo.cell_grid import CellGrid
from perception.datmo.config import MotionGridConfig
from perception.datmo.elevation import ElevationGrid
from perception.geometry.se3 import inverse
from perception.types import Float, Float32, Float64, Int


@dataclass(frozen=True)
class _Observed:
    """The observations of one scan.

    Attributes:
        cells: (C,) flat numbers in the torus.
        order: (C,) how many observations the cell had before.
    """

    cells: Int
    order: Int


class CellHistory:
    """The mean of the last m observations of each cell, made within the last n scans."""

    def __init__(self, size: int, scans: int, max_observations: int, min_observations: int) -> None:
        """Start with an empty window.

        Args:
            size: Number of cells along each side of the window.
            scans: Number of scans after which an observation is forgotten (n).
            max_observations: Largest number of observations of a cell that are averaged, the latest (m).
            min_observations: Smallest number of observations of a cell that has a mean (k).
        """
        self.size = size
        self._max_observations = min(max_observations, scans)
        self._min_observations = min_observations
        self._queue: deque[_Observed] = deque(maxlen=scans)
        self._low = np.zeros(2, np.int64)
        # Observations are numbered cell by cell; those from `first` to before `next` count.
        self._first = np.zeros(size * size, np.int32)
        self._next = np.zeros(size * size, np.int32)
        self._ring_m = np.zeros(self._max_observations * size * size, np.float32)
        # Sums of float32 in float64 are exact, in any order.
        self._sum_m = np.zeros(size * size)
        self._mean_m = np.zeros(size * size, np.float32)

    @property
    def scans(self) -> int:
        """Number of remembered scans."""
        return len(self._queue)

    def clear(self) -> None:
        """Forget all observations."""
        self._queue.clear()
        self._forget(np.arange(self.size), 0)

    def move_to(self, low: Int) -> None:
        """Move the window to start at a (2,) cell of the plane; cells that leave it are forgotten."""
        for axis in (0, 1):
            steps = int(low[axis] - self._low[axis])
            # Cells enter at the far end where the window moves up, else at the near end.
            start = self._low[axis] + self.size if steps > 0 else low[axis]
            entering = start + np.arange(min(abs(steps), self.size))
            self._forget(entering % self.size, axis)
        self._low = np.array(low, np.int64)

    def observe(self, window_m: Float32) -> None:
        """Add one scan's (size, size) values over the window, NaN where a cell was not observed."""
        if len(self._queue) == self._queue.maxlen:
            self._expire(self._queue.popleft())
        torus_m = np.roll(window_m, self._low % self.size, axis=(0, 1)).ravel()
        cells = np.flatnonzero(~np.isnan(torus_m))
        values_m, order = torus_m.take(cells), self._next.take(cells)
        first = self._first.take(cells)
        slot = self._slot(cells, order)
        is_full = order - first == self._max_observations
        # A full ring gives up the value in whose place the new one goes.
        replaced_m = self._ring_m.take(slot) * is_full
        self._ring_m[slot] = values_m
        self._first[cells] = first + is_full
        self._next[cells] = order + 1
        self._add(cells, values_m.astype(np.float64) - replaced_m)
        self._queue.append(_Observed(cells.astype(np.int32), order))

    def mean_m(self) -> Float32:
        """Return (size, size) means over the window, 0 where fewer than k observations count."""
        mean_m = self._mean_m.reshape(self.size, self.size)
        return np.roll(mean_m, -(self._low % self.size), axis=(0, 1))

    def _expire(self, scan: _Observed) -> None:
        # Observations that were replaced or left the window are gone already.
        remains = np.flatnonzero(self._first.take(scan.cells) == scan.order)
        cells, order = scan.cells.take(remains), scan.order.take(remains)
        self._first[cells] += 1
        self._add(cells, -self._ring_m.take(self._slot(cells, order)))

    def _add(self, cells: Int, change_m: Float) -> None:
        """Change the sums of cells whose numbers of observations are up to date."""
        sum_m = self._sum_m.take(cells) + change_m
        self._sum_m[cells] = sum_m
        count = self._next.take(cells) - self._first.take(cells)
        self._mean_m[cells] = sum_m / np.maximum(count, 1) * (count >= self._min_observations)

    def _slot(self, cells: Int, order: Int) -> Int:
        """Return where in the rings the observations lie."""
        return np.asarray((order % self._max_observations).astype(np.int64) * self.size**2 + cells)

    def _forget(self, lines: Int, axis: int) -> None:
        """Forget the rows (axis 0) or columns (axis 1) of the torus."""
        where = (lines, slice(None)) if axis == 0 else (slice(None), lines)
        first, following, sum_m, mean_m = (
            torus.reshape(self.size, self.size)
            for torus in (self._first, self._next, self._sum_m, self._mean_m)
        )
        first[where] = following[where]
        sum_m[where] = mean_m[where] = 0


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
