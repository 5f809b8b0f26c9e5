"""The default ground: one smooth surface of heights, fitted robustly, coarse to fine.

1. A plane is fitted to the lowest points of small cells, then a stiff surface that bends with the road but not
   around a car.
2. All points near the stiff surface are averaged by small cells, and a flexible surface is fitted to
   the averages: it follows camber, crests and kerbs.
3. Averages of earlier scans fill the gaps of the newest: behind obstacles, close to the vehicle, and between the
   beams of a sparse sensor.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from perception.geometry.grids import LocalArea
from perception.geometry.height_grid import HeightGrid, HeightSamples, HeightSurface
from perception.geometry.se3 import inverse
from perception.localization.scan_window import PosedScan, ScanWindow
from perception.obstacles.config import GroundSurfaceConfig
from perception.sensor import LidarModel
from perception.types import ArrayTable, Bool, Float32, Float64, Int


@dataclass(frozen=True)
class _CellPoints(ArrayTable):
    """Points of one scan on or near the ground, and the small cell of each.

    Attributes:
        x, y, z: (N,) metres.
        cells: (N,) number of the cell.
    """

    x: Float32
    y: Float32
    z: Float32
    cells: Int

    @property
    def xyz(self) -> Float64:
        return np.column_stack([self.x, self.y, self.z]).astype(np.float64)


@dataclass(frozen=True)
class _Memory:
    """Averages of one earlier scan, and its pose."""

    samples: HeightSamples
    world_SE3_velo: Float64


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
        area, margin_m = area or LocalArea(), self._config.margin_m
        low_m = (-area.behind_m - margin_m, -area.side_m - margin_m)
        high_m = (area.ahead_m + margin_m, area.side_m + margin_m)
        self._stiff = HeightGrid.covering(low_m, high_m, 2 * self._config.cell_m)
        self._fine = HeightGrid.covering(low_m, high_m, self._config.cell_m)
        self._samples = HeightGrid.covering(low_m, high_m, self._config.sample_m)
        self._footing = _footing(sensor.height_m)
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
        scan, config = window.newest, self._config
        points = self._points_over_grid(scan)
        memory = self._recall(scan.world_SE3_velo)
        stiff = self._stiff_surface(self._lowest(points).joined(memory))
        averages, is_clean = self._averages(points, stiff)
        samples = averages.joined(self._gaps(memory, averages))
        coarse_m = self._stiff.bilinear(self._fine.nodes_xy_m).interpolate(stiff)
        fine = self._robust_fit(
            self._fine, samples, coarse_m, config.scales_m, config.fine_stiffness
        )
        self._remember(averages[is_clean], scan)
        return HeightSurface(self._fine, fine)

    def _points_over_grid(self, scan: PosedScan) -> _CellPoints:
        """Return the points over the grid, up to where obstacles matter."""
        stride = max(-(-len(scan.points_velo) // self._config.max_points), 1)
        x, y, z = scan.points_velo[::stride, :3].T.copy()
        grid = self._samples
        per_m = np.float32(1 / grid.cell_m)
        i, j = (x - np.float32(grid.x0_m)) * per_m, (y - np.float32(grid.y0_m)) * per_m
        inside = (i >= 0) & (i < grid.nodes_x - 1) & (j >= 0) & (j < grid.nodes_y - 1)
        rows = np.flatnonzero(inside)
        cells = i[rows].astype(np.int64) * grid.nodes_y + j[rows].astype(np.int64)
        return _CellPoints(x[rows], y[rows], z[rows], cells)

    def _lowest(self, points: _CellPoints) -> HeightSamples:
        """Return the lowest point of each small cell, where its height can be that of the ground."""
        off_level_m = np.abs(points.z + self._height_m)
        reach_m = np.hypot(points.x, points.y)
        points = points[off_level_m < self._config.max_step_m + self._config.max_slope * reach_m]
        lowest_m = np.full(self._samples.size, np.inf, np.float32)
        np.minimum.at(lowest_m, points.cells, points.z)
        lowest = points[points.z == lowest_m[points.cells]]
        return HeightSamples(lowest.xyz, np.ones(len(lowest.z)))

    def _stiff_surface(self, samples: HeightSamples) -> Float64:
        config = self._config
        plane = _robust_plane(samples.points, self._height_m)
        plane_m = self._stiff.nodes_xy_m @ plane[:2] + plane[2]
        return self._robust_fit(
            self._stiff, samples, plane_m, config.stiff_scales_m, config.stiffness
        )

    def _robust_fit(
        self,
        grid: HeightGrid,
        samples: HeightSamples,
        start_m: Float64,
        scales_m: tuple[float, ...],
        stiffness: float,
    ) -> Float64:
        """Fit repeatedly, with less weight for samples of larger residual (Geman-McClure)."""
        place, heights_m = grid.bilinear(samples.points), start_m
        for scale_m in scales_m:
            misfit_m = samples.points[:, 2] - place.interpolate(heights_m)
            scale = np.where(misfit_m < 0, scale_m * self._config.low_scale_ratio, scale_m)
            weights = samples.weights / (1 + (misfit_m / scale) ** 2) ** 2
            weighted = HeightSamples(samples.points, weights)
            heights_m = grid.fit(weighted, place, stiffness, heights_m)
        return heights_m

    def _averages(self, points: _CellPoints, stiff_m: Float64) -> tuple[HeightSamples, Bool]:
        """Average the points near the first surface by small cells.

        Returns:
            The averages, and which of them come from cells without obstacles.
        """
        config, size = self._config, self._samples.size
        centers = self._samples.nodes_xy_m + self._samples.cell_m / 2
        ground_m = self._stiff.bilinear(centers).interpolate(stiff_m).astype(np.float32)
        above_m = points.z - ground_m[points.cells]
        low_m, high_m = config.obstacle_band_m
        above_ground = points.cells[(above_m > low_m) & (above_m < high_m)]
        near = points[np.abs(above_m) < config.band_m]
        counts = np.bincount(near.cells, minlength=size)
        seen = np.flatnonzero(counts)
        sums = [np.bincount(near.cells, values, size)[seen] for values in (near.x, near.y, near.z)]
        means = np.column_stack(sums) / counts[seen, None]
        weights = np.minimum(counts[seen], config.full_count) / config.full_count
        return HeightSamples(means, weights), np.bincount(above_ground, minlength=size)[seen] == 0

    def _recall(self, world_SE3_velo: Float64) -> HeightSamples:
        """Return the remembered averages and the ground below the vehicle, in the newest scan's frame, inside the grid."""
        velo_SE3_world = inverse(world_SE3_velo)
        recalled = self._footing
        for memory in self._memories:
            moved = _moved(memory.samples.points, velo_SE3_world @ memory.world_SE3_velo)
            recalled = recalled.joined(HeightSamples(moved, memory.samples.weights))
        inside = self._cells_of(recalled.points) >= 0
        weights = self._config.memory_weight * recalled.weights
        return HeightSamples(recalled.points[inside], weights[inside])

    def _gaps(self, memory: HeightSamples, newest: HeightSamples) -> HeightSamples:
        """Return the remembered averages of cells that the newest scan did not observe."""
        is_observed = np.zeros(self._fine.size, bool)
        is_observed[self._cells_of(newest.points)] = True
        rows = ~is_observed[self._cells_of(memory.points)]
        return memory[rows]

    def _cells_of(self, points: Float64) -> Int:
        """Return the cell of the surface's grid that each point lies in, -1 outside."""
        grid = self._fine
        i = np.floor((points[:, 0] - grid.x0_m) / grid.cell_m).astype(np.int64)
        j = np.floor((points[:, 1] - grid.y0_m) / grid.cell_m).astype(np.int64)
        inside = (i >= 0) & (i < grid.nodes_x - 1) & (j >= 0) & (j < grid.nodes_y - 1)
        return np.where(inside, i * grid.nodes_y + j, -1)

    def _remember(self, clean: HeightSamples, scan: PosedScan) -> None:
        if self._updates % self._config.remember_every == 0:
            self._memories.append(_Memory(clean, scan.world_SE3_velo))
        self._updates += 1


_PLANE_ROUNDS = 12
_PLANE_SAMPLE = 1200  # points are plenty for three numbers
_PLANE_PRIOR = np.array(
    [30.0, 30.0, 1.0]
)  # level ground at the sensor's height, as if observed once


def _robust_plane(points: Float64, height_m: float) -> Float64:
    """Fit z = p x + q y + r to (N, 3) low points, starting from level ground, as (p, q, r).

    The scale of the robust weights grows with range, as slopes do, and shrinks round by round.
    """
    points = points[:: max(1, len(points) // _PLANE_SAMPLE)]
    basis = np.column_stack([points[:, :2], np.ones(len(points))])
    range_m = np.hypot(points[:, 0], points[:, 1])
    level = np.array([0.0, 0.0, -height_m])
    plane = level
    for number in range(_PLANE_ROUNDS):
        scale_m = np.maximum(0.08, (0.25 + 0.06 * range_m) * 0.7**number)
        misfit_m = points[:, 2] - basis @ plane
        scale_m = np.where(misfit_m < 0, 2 * scale_m, scale_m)
        weighted = basis / (1 + (misfit_m / scale_m) ** 2)[:, None] ** 2
        plane = np.linalg.solve(
            weighted.T @ basis + np.diag(_PLANE_PRIOR),
            weighted.T @ points[:, 2] + _PLANE_PRIOR * level,
        )
    return plane


def _footing(height_m: float) -> HeightSamples:
    """Return the ground between the wheels of the vehicle, at the sensor's mounting height."""
    x, y = np.meshgrid([-1.5, 0.0, 1.5], [-0.75, 0.0, 0.75])
    z = np.full(x.size, -height_m)
    return HeightSamples(np.column_stack([x.ravel(), y.ravel(), z]), np.ones(x.size))


def _moved(points: Float64, dst_SE3_src: Float64) -> Float64:
    return points @ dst_SE3_src[:3, :3].T + dst_SE3_src[:3, 3]
