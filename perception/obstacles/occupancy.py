"""Free, occupied and unknown places on the ground around the vehicle, as planners take them.

A place is free where a beam passed so low that it would have met an obstacle of 0.3 m, on its way to a return from the
ground. One beam ends at a range r: between r (1 - 0.3 m / height of the LiDAR) and r it was below 0.3 m.

    LiDAR  o
           | `  .
    height |      `  .   0.3 m
           |           ` |.
    -------+-------------+--`---- ground
           unknown       | free |

Obstacles hide what is behind them, and make the cells around them unknown rather than free.
"""

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from perception.kernels.polar_cells import cells_of_points, passed_cells
from perception.obstacles.config import OccupancyConfig
from perception.types import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    Bool,
    Float32,
    Float64,
    Int,
    OccupancyGrid,
    PointState,
    Result,
)

_MIN_OBSTACLE_M = 0.3
_SECTORS = 720  # half a degree: 17 cm at 20 m
_MARGIN = np.ones((3, 3), np.uint8)
_GROUND_STEP = 4  # among its returns, whose median is the height of the LiDAR
_CONFIG = OccupancyConfig()


def occupancy_grid(
    result: Result, config: OccupancyConfig = _CONFIG, *, with_moving: bool = True
) -> OccupancyGrid:
    """Return the grid of one scan, and of the static obstacles of the scans before it.

    Args:
        result: Result of the scan.
        config: Reach and resolution.
        with_moving: Whether what moves occupies its place; else that is unknown, or free where the ground is seen.
    """
    return OccupancyEvidence.of(result, config).grid(with_moving=with_moving)


@dataclass(frozen=True)
class OccupancyEvidence:
    """What a scan, and the scans before it, say of each of H x W cells.

    Attributes:
        is_free: (H, W) whether beams passed low, which saw no obstacle before.
        was_static: (H, W) whether a static obstacle of earlier scans is there, where nothing is seen now.
        holds_static: (H, W) whether static points lie there.
        holds_moving: (H, W) whether moving points lie there.
        is_static: (H, W) whether static points lie there above the lowest obstacle.
        is_moving: (H, W) whether moving points lie there above the lowest obstacle.
        origin_m: (3,) corner of the first cell in the world, at the height of the ground.
        cell_m: Edge of a cell in metres.
    """

    is_free: Bool
    was_static: Bool
    holds_static: Bool
    holds_moving: Bool
    is_static: Bool
    is_moving: Bool
    origin_m: Float64
    cell_m: float

    @classmethod
    def of(cls, result: Result, config: OccupancyConfig = _CONFIG) -> Self:
        """Collect the evidence of a result."""
        states, points = result.obstacles.point_states, result.frame.points_velo
        pose, frame = result.world_SE3_velo, _CellFrame.around(result.world_SE3_velo, config)
        is_ground, is_moving, is_static = (
            states == one for one in (PointState.GROUND, PointState.MOVING, PointState.STATIC)
        )
        height_m = _height_m(points[np.flatnonzero(is_ground)[::_GROUND_STEP]])
        low_share = max(1 - _MIN_OBSTACLE_M / height_m, 0.0)
        cells, xy_m = frame.cells(points)
        is_free = frame.passed(xy_m, is_ground, is_moving | is_static, low_share)
        # Static places of earlier scans, as far as nothing is seen there now.
        before, _ = frame.cells(result.obstacles.static.centers_m)
        was_static = frame.holding(before) & ~is_free & ~frame.holding(cells)
        static, moving = np.flatnonzero(is_static), np.flatnonzero(is_moving)
        high_static, high_moving = (
            rows[result.ground.distance_m(points[rows]) >= _MIN_OBSTACLE_M]
            for rows in (static, moving)
        )
        below_m = height_m if np.isfinite(height_m) else 0.0
        return cls(
            is_free=is_free,
            was_static=was_static,
            holds_static=frame.holding(cells[static]),
            holds_moving=frame.holding(cells[moving]),
            is_static=frame.holding(cells[high_static]),
            is_moving=frame.holding(cells[high_moving]),
            origin_m=np.append(frame.offset_m + pose[:2, 3], pose[2, 3] - below_m),
            cell_m=config.cell_m,
        )

    def grid(self, *, with_moving: bool = True) -> OccupancyGrid:
        """Return the grid; `with_moving` as of `occupancy_grid`."""
        occupied, held = self.was_static | self.is_static, self.was_static | self.holds_static
        if with_moving:
            occupied, held = occupied | self.is_moving, held | self.holds_moving
        # What is lower than the lowest obstacle may be a kerb: neither free nor occupied.
        is_doubtful = cv2.dilate((occupied | held).astype(np.uint8), _MARGIN) > 0
        grid = np.full(self.is_free.shape, UNKNOWN, np.int8)
        grid[self.is_free & ~is_doubtful] = FREE
        grid[occupied] = OCCUPIED
        return OccupancyGrid(grid, self.origin_m, self.cell_m)


@dataclass(frozen=True)
class _CellFrame:
    """Cells around the LiDAR, along the axes of the world.

    Attributes:
        rotation: (2, 3) rotation from the LiDAR frame to x and y of the world.
        offset_m: (2,) corner of the first cell, from the LiDAR.
        count: Number of rows and columns.
        cell_m: Edge of a cell in metres.
    """

    rotation: Float64
    offset_m: Float64
    count: int
    cell_m: float

    @classmethod
    def around(cls, world_SE3_velo: Float64, config: OccupancyConfig) -> Self:
        """Return the cells around a LiDAR; whatever its pose, their corners are multiples of their edge in the world."""
        lidar_m, cell_m = world_SE3_velo[:2, 3], config.cell_m
        corner_m = np.floor((lidar_m - config.reach_m) / cell_m) * cell_m
        count = int(np.ceil(2 * config.reach_m / cell_m)) + 1
        return cls(world_SE3_velo[:2, :3], corner_m - lidar_m, count, cell_m)

    @property
    def _grid(self) -> tuple[float, float, float]:
        return float(self.offset_m[0]), float(self.offset_m[1]), self.cell_m

    def cells(self, points_velo: Float32) -> tuple[Int, Float64]:
        """Return the (N,) cells of (N, 3+) points and their (N, 2) positions, as `cells_of_points` does."""
        points = np.ascontiguousarray(points_velo, np.float32)
        return cells_of_points(points, np.ascontiguousarray(self.rotation), self._grid, self.count)

    def passed(self, xy_m: Float64, is_ground: Bool, is_obstacle: Bool, low_share: float) -> Bool:
        """Return (H, W) over which cells beams passed low, as `passed_cells` does."""
        returns = xy_m, is_ground, is_obstacle, low_share
        return passed_cells(*returns, self._grid, self.count, _SECTORS)

    def holding(self, cells: Int) -> Bool:
        """Return (H, W) which cells are among (N,) numbers."""
        found = np.zeros(self.count**2 + 1, bool)
        found[cells] = True
        return found[:-1].reshape(self.count, self.count)


def _height_m(ground_velo: Float32) -> float:
    """Return the height of the LiDAR above the returns of the ground nearby."""
    near = ground_velo[np.hypot(ground_velo[:, 0], ground_velo[:, 1]) < 10.0]
    chosen = near if len(near) else ground_velo
    return max(-float(np.median(chosen[:, 2])), _MIN_OBSTACLE_M) if len(chosen) else np.inf
