"""The default ground: one smooth surface of heights, fitted robustly, coarse to fine.

1. A coarse surface is fitted to the lowest points of small cells, round by round less stiff and with less weight for
   what is far from it: level ground below the sensor bends down and up the banks of the road, but not around a car.
2. All points near the coarse surface are averaged by small cells, and a flexible surface is fitted to
   the averages: it follows camber, crests and kerbs.
3. Averages of earlier scans fill the gaps of the newest: behind obstacles, close to the vehicle, and between the
   beams of a sparse sensor.

A fit costs the fourth power of the nodes along a side. So in a wide area both surfaces have few nodes far apart, as the
rings of beams are far from the sensor, and a second flexible surface, with nodes close together, replaces them nearby.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from perception.geometry.grids import MOVING_OBJECT_AREA, LocalArea
from perception.geometry.height_grid import HeightGrid, HeightSamples, HeightSurface
from perception.geometry.se3 import inverse
from perception.kernels.heights import (
    cells_of,
    lowest_of_cells,
    moved_samples,
    points_over_cells,
    sums_of_cells,
)
from perception.localization.scan_window import PosedScan, ScanWindow
from perception.obstacles.config import GroundSurfaceConfig
from perception.sensor import LidarModel
from perception.types import Bool, Float32, Float64, Int

# Measured on real drives.
_MARGIN_M = 3.0  # reach of the surface beyond the local area
# A wider area than this has a whole number of cells in one, of which at most 22 are across, and the cells themselves nearby.
_MAX_CELLS_ACROSS, _WIDE_CELLS_ACROSS = 40, 22
_NEARBY = MOVING_OBJECT_AREA
_WIDE_STEP = 4  # of the remembered averages to which the coarse surface is fitted then
_SAMPLE_M = 0.5  # edge of the cells in which points are averaged
_FULL_COUNT = 5  # points from which on a cell's average has full weight

# Mean slope of the ground seen from the sensor, and by how much its height over the ground differs from its mounting.
_MAX_SLOPE, _MAX_STEP_M = 0.15, 0.5
# Rounds of the coarse surface: the scale of residuals beyond which a sample loses its weight, and the stiffness, the square
# of a residual over that of a curvature. A stiff surface alone keeps to whatever covers most of the area, be it the land
# below a road on a bank. Low points are ground rather than obstacle, and have a larger scale.
_COARSE_ROUNDS: tuple[tuple[float, float], ...] = ((0.6, 100), (0.5, 10), (0.3, 3), (0.15, 1))
_COARSE_LOW_RATIO = 3.0
_FINE_STIFFNESS_M2, _FINE_SCALES_M = 0.3, (0.30, 0.15)  # scales below and above
_BAND_M = 0.20  # from the coarse surface to a point that may be ground

_OBSTACLE_BAND_M = (0.3, 1.5)  # heights of points that make a cell unfit for the memory
_REMEMBER_EVERY = 3  # scans
_MEMORY_WEIGHT = 0.3  # of remembered averages, against 1 of new ones
# Deviation of a height by the poses of two scans beyond which an average tells nothing; no faultless drive has as much.
_MAX_DEVIATION_M = 0.15


@dataclass(frozen=True)
class _Memory:
    """Averages of one earlier scan, its pose, and the covariance of that."""

    samples: HeightSamples
    world_SE3_velo: Float64
    covariance: Float64


class GroundSurfaceEstimator:
    """Estimates the ground of each scan of a drive in turn, remembering a few scans.

    A single scan is a window of one.
    """

    def __init__(
        self,
        sensor: LidarModel,
        area: LocalArea | None = None,
        config: GroundSurfaceConfig | None = None,
    ) -> None:
        self._height_m = sensor.height_m
        self._config = config or GroundSurfaceConfig()
        low_m, high_m = _corners(area or LocalArea())
        cell_m = self._config.cell_m
        across = (high_m[1] - low_m[1]) / cell_m
        is_wide = across > _MAX_CELLS_ACROSS
        wide_m = cell_m * (np.ceil(across / _WIDE_CELLS_ACROSS) if is_wide else 2)
        self._coarse = HeightGrid.covering(low_m, high_m, wide_m)
        self._fine = HeightGrid.covering(low_m, high_m, cell_m)
        self._nearby = _Patch.within(self._fine, *_corners(_NEARBY)) if is_wide else None
        self._samples = HeightGrid.covering(low_m, high_m, _SAMPLE_M)
        cell_centers_m = self._samples.nodes_xy_m + self._samples.cell_m / 2
        self._coarse_at_cells = self._coarse.bilinear(cell_centers_m)
        self._coarse_at_fine = self._coarse.bilinear(self._fine.nodes_xy_m)
        footing = _footing(sensor.height_m)
        self._footing = footing[self._cells_of(footing.points) >= 0]
        self._memories: deque[_Memory] = deque(maxlen=self._config.remembered_scans)
        self._updates = 0

    def update(self, window: ScanWindow) -> HeightSurface:
        """Return the ground in the frame of the window's newest scan.

        Only the newest scan is read; averages of earlier ones are remembered. A window of one scan starts a new drive.
        Where neither this scan nor the memory has ground, the surface is continued smoothly; without any ground it is
        level at the sensor's height.
        """
        if len(window) == 1:
            self._memories.clear()
            self._updates = 0
        scan = window.newest
        stride = max(-(-len(scan.points_velo) // self._config.max_points), 1)
        points, cells = points_over_cells(scan.points_velo, stride, self._samples.numbers)
        memory = self._recall(scan)
        coarse = self._coarse_surface(self._lowest(points, cells).joined(self._thinned(memory)))
        averages, is_clean = self._averages(points, cells, coarse)
        samples = averages.joined(self._gaps(memory, averages))
        self._remember(averages[is_clean], scan)
        return HeightSurface(self._fine, self._flexible_surface(samples, coarse))

    def _thinned(self, memory: HeightSamples) -> HeightSamples:
        """Return fewer remembered averages of more weight where the nodes of the coarse surface are far apart."""
        step = _WIDE_STEP if self._nearby is not None else 1
        return HeightSamples(memory.points[::step], step * memory.weights[::step])

    def _flexible_surface(self, samples: HeightSamples, coarse_m: Float64) -> Float64:
        """Return the heights of the surface that follows the averages, starting from the coarse one."""
        if self._nearby is None:
            start_m = self._coarse_at_fine.interpolate(coarse_m)
            return self._flexible_fit(self._fine, samples, start_m)
        wide_m = self._flexible_fit(self._coarse, samples, coarse_m)
        heights_m = self._coarse_at_fine.interpolate(wide_m)
        patch = self._nearby
        is_near = cells_of(samples.points, patch.grid.numbers) >= 0
        near_m = self._flexible_fit(patch.grid, samples[is_near], heights_m[patch.nodes])
        heights_m[patch.nodes] += patch.shares * (near_m - heights_m[patch.nodes])
        return heights_m

    def _flexible_fit(self, grid: HeightGrid, samples: HeightSamples, start_m: Float64) -> Float64:
        heights_m = start_m
        for _ in range(self._config.rounds):
            heights_m = grid.fit(
                samples, _FINE_STIFFNESS_M2 / grid.cell_m**2, heights_m, _FINE_SCALES_M
            )
        return heights_m

    def _lowest(self, points: Float32, cells: Int) -> HeightSamples:
        """Return the lowest point of each small cell, where its height can be that of the ground."""
        lowest = lowest_of_cells(
            points, cells, self._samples.size, -self._height_m, _MAX_STEP_M, _MAX_SLOPE
        )
        return HeightSamples(lowest, np.ones(len(lowest)))

    def _coarse_surface(self, samples: HeightSamples) -> Float64:
        """Fit the lowest points, which bend the surface the more, the more of the ground around them is sampled.

        Where few returns lie far apart, each can be from something that hides the ground, and stiffness decides.
        """
        cells = cells_of(samples.points, self._coarse.numbers) + 1  # 0 outside
        shares = np.bincount(cells, samples.weights) * (_SAMPLE_M / self._coarse.cell_m) ** 2
        weighed = HeightSamples(samples.points, samples.weights * np.minimum(shares[cells], 1.0))
        heights_m = np.full(self._coarse.size, -self._height_m)
        for scale_m, stiffness_m2 in _COARSE_ROUNDS:
            scales_m = (_COARSE_LOW_RATIO * scale_m, scale_m)
            stiffness = stiffness_m2 / self._coarse.cell_m**2
            heights_m = self._coarse.fit(weighed, stiffness, heights_m, scales_m)
        return heights_m

    def _averages(
        self, points: Float32, cells: Int, coarse_m: Float64
    ) -> tuple[HeightSamples, Bool]:
        """Average the points near the coarse surface by small cells.

        Returns:
            The averages, and which of them come from cells without obstacles.
        """
        ground_m = self._coarse_at_cells.interpolate(coarse_m)
        sums, has_obstacle = sums_of_cells(points, cells, ground_m, _BAND_M, *_OBSTACLE_BAND_M)
        seen = np.flatnonzero(sums[:, 3])
        counts = sums[seen, 3]
        weights = np.minimum(counts, _FULL_COUNT) / _FULL_COUNT
        return HeightSamples(sums[seen, :3] / counts[:, None], weights), ~has_obstacle[seen]

    def _recall(self, scan: PosedScan) -> HeightSamples:
        """Return the remembered averages and the ground below the vehicle, in the newest scan's frame, inside the grid.

        Averages whose height the two poses do not tell are left out.
        """
        velo_SE3_world = inverse(scan.world_SE3_velo)
        world_R_velo = np.ascontiguousarray(scan.world_SE3_velo[:3, :3])
        parts = [self._footing]
        for memory in self._memories:
            covariance = (scan.covariance + memory.covariance)[2:5, 2:5]
            samples = moved_samples(
                memory.samples.points,
                memory.samples.weights,
                velo_SE3_world @ memory.world_SE3_velo,
                world_R_velo,
                np.ascontiguousarray(covariance),
                _MAX_DEVIATION_M,
                self._fine.numbers,
            )
            parts.append(HeightSamples(*samples))
        recalled = HeightSamples.concatenate(parts)
        return HeightSamples(recalled.points, _MEMORY_WEIGHT * recalled.weights)

    def _gaps(self, memory: HeightSamples, newest: HeightSamples) -> HeightSamples:
        """Return the remembered averages of cells that the newest scan did not observe."""
        is_observed = np.zeros(self._fine.size, bool)
        is_observed[self._cells_of(newest.points)] = True
        rows = ~is_observed[self._cells_of(memory.points)]
        return memory[rows]

    def _cells_of(self, points: Float64) -> Int:
        """Return the cell of the surface's grid that each point lies in, -1 outside."""
        return cells_of(np.ascontiguousarray(points), self._fine.numbers)

    def _remember(self, clean: HeightSamples, scan: PosedScan) -> None:
        if self._updates % _REMEMBER_EVERY == 0:
            self._memories.append(_Memory(clean, scan.world_SE3_velo, scan.covariance))
        self._updates += 1


@dataclass(frozen=True)
class _Patch:
    """A part of a grid, whose surface passes into that of the grid within the margin.

    Attributes:
        grid: Nodes of the part.
        nodes: (grid.size,) numbers of these nodes in the whole grid.
        shares: (grid.size,) share of the part's surface at each node: 1 inside of the margin, 0 at the border.
    """

    grid: HeightGrid
    nodes: Int
    shares: Float64

    @classmethod
    def within(
        cls, whole: HeightGrid, low_m: tuple[float, float], high_m: tuple[float, float]
    ) -> "_Patch":
        """Return the nodes of a grid in a rectangle, or those of the grid that are nearest to it."""
        start = np.floor((np.array(low_m) - (whole.x0_m, whole.y0_m)) / whole.cell_m)
        stop = np.ceil((np.array(high_m) - (whole.x0_m, whole.y0_m)) / whole.cell_m)
        last = np.array([whole.nodes_x, whole.nodes_y]) - 1
        (i, j), (i_stop, j_stop) = (
            np.clip(one, 0, last).astype(int).tolist() for one in (start, stop)
        )
        grid = HeightGrid(
            whole.x0_m + i * whole.cell_m,
            whole.y0_m + j * whole.cell_m,
            whole.cell_m,
            i_stop - i + 1,
            j_stop - j + 1,
        )
        rows, columns = np.arange(i, i_stop + 1), np.arange(j, j_stop + 1)
        inside = np.minimum.outer(
            np.minimum(rows - i, i_stop - rows), np.minimum(columns - j, j_stop - columns)
        )
        shares = np.minimum(inside * whole.cell_m / _MARGIN_M, 1.0)
        nodes = rows[:, None] * whole.nodes_y + columns
        return cls(grid, nodes.ravel(), shares.ravel())


def _corners(area: LocalArea) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the lowest and the highest x and y of an area with its margin."""
    low_m = (-area.behind_m - _MARGIN_M, -area.side_m - _MARGIN_M)
    return low_m, (area.ahead_m + _MARGIN_M, area.side_m + _MARGIN_M)


def _footing(height_m: float) -> HeightSamples:
    """Return the ground between the wheels of the vehicle, at the sensor's mounting height."""
    x, y = np.meshgrid([-1.5, 0.0, 1.5], [-0.75, 0.0, 0.75])
    z = np.full(x.size, -height_m)
    return HeightSamples(np.column_stack([x.ravel(), y.ravel(), z]), np.ones(x.size))
