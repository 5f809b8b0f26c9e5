"""Cells of the occupancy grid against exact truth of points.

- A cell of the local area is occupied where the scan holds a return 0.3 to 2 m above the ground of what is no ground, and
  free where it holds returns of the ground and none of anything else below 2 m; others do not count.
- The ground is at the nearest return of the ground, seen from above.
- Cells within 20 m of the LiDAR count.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.spatial import cKDTree

from perception.evaluation.ground import GROUND_CLASSES, UNLABELLED_CLASSES
from perception.evaluation.report import Metric, SummedMetrics
from perception.geometry.grids import LocalArea
from perception.types import FREE, OCCUPIED, Float64, OccupancyGrid, PointTruth, Result

_REACH_M = 20.0
_MIN_M, _MAX_M = 0.3, 2.0


@dataclass(frozen=True)
class FreeSpaceCounts(SummedMetrics):
    """Cells of the grids of any number of scans.

    Attributes:
        occupied: Number of occupied cells by the truth.
        false_free: Number of these that are called free.
        free: Number of free cells by the truth.
        true_free: Number of these that are called free.
        false_occupied: Number of these that are called occupied.
    """

    occupied: Annotated[int, Metric("occupied")] = 0
    false_free: Annotated[int, Metric("called free")] = 0
    free: Annotated[int, Metric("free")] = 0
    true_free: int = 0
    false_occupied: int = 0

    @property
    def false_free_share(self) -> Annotated[float, Metric("called free [%]", ".3%")]:
        """Share of the occupied cells that are called free; NaN without any."""
        return self.false_free / self.occupied if self.occupied else float("nan")

    @property
    def false_occupied_share(self) -> Annotated[float, Metric("free, called occupied [%]", ".2%")]:
        """Share of the free cells that are called occupied; NaN without any."""
        return self.false_occupied / self.free if self.free else float("nan")

    @property
    def true_free_share(self) -> Annotated[float, Metric("free, called free [%]", ".1%")]:
        """Share of the free cells that are called free; NaN without any."""
        return self.true_free / self.free if self.free else float("nan")


def count_free_space(
    result: Result, grid: OccupancyGrid, truth: PointTruth, area: LocalArea
) -> FreeSpaceCounts:
    """Compare a grid with the exact class of each point of its scan."""
    points = result.frame.points_velo
    is_ground = np.isin(truth.classes, GROUND_CLASSES)
    if not is_ground.any():
        return FreeSpaceCounts()
    counts = area.contains_xy(points) & (np.hypot(points[:, 0], points[:, 1]) < _REACH_M)
    counts &= points[:, :3].any(axis=1)
    _, nearest = cKDTree(points[is_ground, :2]).query(points[counts, :2])
    rise_m = np.zeros(len(points))
    rise_m[counts] = points[counts, 2] - points[is_ground][nearest, 2]
    is_other = counts & ~is_ground & (rise_m < _MAX_M)
    is_high = is_other & (rise_m >= _MIN_M) & ~np.isin(truth.classes, UNLABELLED_CLASSES)
    rotation, lidar_m = result.world_SE3_velo[:2, :3], result.world_SE3_velo[:2, 3]
    xy_m = points[:, :3].astype(np.float64) @ rotation.T + lidar_m
    cells = np.floor((xy_m - grid.origin_m[:2]) / grid.cell_m).astype(np.int64)
    occupied = np.unique(cells[is_high], axis=0)
    others = np.unique(cells[is_other], axis=0)
    free = np.unique(cells[counts & is_ground], axis=0)
    free = free[~_is_among(free, others)]
    of_occupied, of_free = (grid.states_at(_centers(grid, one)) for one in (occupied, free))
    return FreeSpaceCounts(
        occupied=len(occupied),
        false_free=int(np.count_nonzero(of_occupied == FREE)),
        free=len(free),
        true_free=int(np.count_nonzero(of_free == FREE)),
        false_occupied=int(np.count_nonzero(of_free == OCCUPIED)),
    )


def _centers(grid: OccupancyGrid, cells: np.ndarray) -> Float64:
    return np.asarray(grid.origin_m[:2] + (cells + 0.5) * grid.cell_m, np.float64)


def _is_among(cells: np.ndarray, others: np.ndarray) -> np.ndarray:
    keys = [one[:, 0] * (1 << 32) + one[:, 1] for one in (cells, others)]
    return np.asarray(np.isin(*keys))
