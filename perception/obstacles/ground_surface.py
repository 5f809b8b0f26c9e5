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
from perception.kernels.heights import (
    cells_of,
    lowest_of_cells,
    points_over_cells,
    robust_plane,
    sums_of_cells,
)
from perception.localization.pose_covariance import height_deviations_m
from perception.localization.scan_window import PosedScan, ScanWindow
from perception.obstacles.config import GroundSurfaceConfig
from perception.sensor import LidarModel
from perception.types import Bool, Float32, Float64, Int

# Measured on real drives.
_MARGIN_M = 3.0  # reach of the surface beyond the local area
# In a wider area nodes are farther apart: a fit costs the square of their number.
_MAX_CELLS_ACROSS = 60
_SAMPLE_M = 0.5  # edge of the cells in which points are averaged
_FULL_COUNT = 5  # points from which on a cell's average has full weight
_PLANE_ROUNDS = 12
_PLANE_SAMPLE = 1200  # points are plenty for three numbers

# Mean slope of the ground seen from the sensor, and by how much its height over the ground differs from its mounting.
_MAX_SLOPE, _MAX_STEP_M = 0.15, 0.5
# Of the coarse surface, and of the fine one. The coarse one's nodes are twice as far apart: 25 there is 100 here.
_STIFFNESS, _FINE_STIFFNESS = 25.0, 0.3
# Scales of the robust fits, round by round; low points are ground rather than obstacle, and have twice the scale.
_SCALES_M, _FINE_SCALE_M, _LOW_SCALE_RATIO = (0.3, 0.15, 0.1), 0.15, 2.0
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
        area = area or LocalArea()
        low_m = (-area.behind_m - _MARGIN_M, -area.side_m - _MARGIN_M)
        high_m = (area.ahead_m + _MARGIN_M, area.side_m + _MARGIN_M)
        cell_m = max(self._config.cell_m, (high_m[1] - low_m[1]) / _MAX_CELLS_ACROSS)
        self._stiffness_ratio = (self._config.cell_m / cell_m) ** 2  # the same bend of the surface
        self._stiff = HeightGrid.covering(low_m, high_m, 2 * cell_m)
        self._fine = HeightGrid.covering(low_m, high_m, cell_m)
        self._samples = HeightGrid.covering(low_m, high_m, _SAMPLE_M)
        cell_centers_m = self._samples.nodes_xy_m + self._samples.cell_m / 2
        self._stiff_at_cells = self._stiff.bilinear(cell_centers_m)
        self._stiff_at_fine = self._stiff.bilinear(self._fine.nodes_xy_m)
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
        scan = window.newest
        stride = max(-(-len(scan.points_velo) // self._config.max_points), 1)
        points, cells = points_over_cells(scan.points_velo, stride, self._samples.numbers)
        memory = self._recall(scan)
        stiff = self._stiff_surface(self._lowest(points, cells).joined(memory))
        averages, is_clean = self._averages(points, cells, stiff)
        samples = averages.joined(self._gaps(memory, averages))
        coarse_m = self._stiff_at_fine.interpolate(stiff)
        scales_m = (_FINE_SCALE_M,) * self._config.rounds
        fine = self._robust_fit(self._fine, samples, coarse_m, scales_m, _FINE_STIFFNESS)
        self._remember(averages[is_clean], scan)
        return HeightSurface(self._fine, fine)

    def _lowest(self, points: Float32, cells: Int) -> HeightSamples:
        """Return the lowest point of each small cell, where its height can be that of the ground."""
        lowest = lowest_of_cells(
            points, cells, self._samples.size, -self._height_m, _MAX_STEP_M, _MAX_SLOPE
        )
        return HeightSamples(lowest, np.ones(len(lowest)))

    def _stiff_surface(self, samples: HeightSamples) -> Float64:
        sample = samples.points[:: max(1, len(samples) // _PLANE_SAMPLE)]
        plane = robust_plane(np.ascontiguousarray(sample), -self._height_m, _PLANE_ROUNDS)
        plane_m = self._stiff.nodes_xy_m @ plane[:2] + plane[2]
        return self._robust_fit(self._stiff, samples, plane_m, _SCALES_M, _STIFFNESS)

    def _robust_fit(
        self,
        grid: HeightGrid,
        samples: HeightSamples,
        start_m: Float64,
        scales_m: tuple[float, ...],
        stiffness: float,
    ) -> Float64:
        """Fit repeatedly, with less weight for samples of larger residual."""
        heights_m = start_m
        for scale_m in scales_m:
            low_m = scale_m * _LOW_SCALE_RATIO
            scales = (low_m, scale_m)
            heights_m = grid.fit(samples, self._stiffness_ratio * stiffness, heights_m, scales)
        return heights_m

    def _averages(
        self, points: Float32, cells: Int, stiff_m: Float64
    ) -> tuple[HeightSamples, Bool]:
        """Average the points near the first surface by small cells.

        Returns:
            The averages, and which of them come from cells without obstacles.
        """
        ground_m = self._stiff_at_cells.interpolate(stiff_m)
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
        recalled = self._footing
        for memory in self._memories:
            velo_SE3_then = velo_SE3_world @ memory.world_SE3_velo
            moved = memory.samples.points @ velo_SE3_then[:3, :3].T + velo_SE3_then[:3, 3]
            deviations_m = height_deviations_m(
                scan.covariance + memory.covariance, moved @ scan.world_SE3_velo[:3, :3].T
            )
            samples = HeightSamples(moved, memory.samples.weights)
            recalled = recalled.joined(samples[deviations_m <= _MAX_DEVIATION_M])
        inside = self._cells_of(recalled.points) >= 0
        weights = _MEMORY_WEIGHT * recalled.weights
        return HeightSamples(recalled.points[inside], weights[inside])

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


def _footing(height_m: float) -> HeightSamples:
    """Return the ground between the wheels of the vehicle, at the sensor's mounting height."""
    x, y = np.meshgrid([-1.5, 0.0, 1.5], [-0.75, 0.0, 0.75])
    z = np.full(x.size, -height_m)
    return HeightSamples(np.column_stack([x.ravel(), y.ravel(), z]), np.ones(x.size))
