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
from typing import Final, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.types import Bool, Float32, Float64, PointState, Result, require_shape

# As of nav_msgs/OccupancyGrid.
UNKNOWN: Final = -1
FREE: Final = 0
OCCUPIED: Final = 100

_MIN_OBSTACLE_M = 0.3
_SECTORS = 720  # half a degree: 17 cm at 20 m
_MARGIN = np.ones((3, 3), np.uint8)


@dataclass(frozen=True)
class OccupancyGrid:
    """Cells on the ground, with the axes of the world.

    Attributes:
        states: (H, W) UNKNOWN, FREE or OCCUPIED; rows along y, columns along x.
        origin_m: (3,) corner of the first cell in the world, at the height of the ground.
        cell_m: Edge of a cell in metres.
    """

    states: NDArray[np.int8]
    origin_m: Float64
    cell_m: float

    def __post_init__(self) -> None:
        """Validate shapes."""
        require_shape("OccupancyGrid.states", self.states, ("H", "W"))
        require_shape("OccupancyGrid.origin_m", self.origin_m, (3,))

    def states_at(self, xy_m: Float64) -> NDArray[np.int8]:
        """Return the (N,) states of (N, 2) positions in the world; UNKNOWN beside the grid."""
        column, row = np.floor((xy_m - self.origin_m[:2]) / self.cell_m).astype(np.int64).T
        height, width = self.states.shape
        is_inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        found = np.full(len(xy_m), UNKNOWN, np.int8)
        found[is_inside] = self.states[row[is_inside], column[is_inside]]
        return found


@dataclass(frozen=True)
class OccupancyConfig:
    """Occupancy grid.

    Attributes:
        reach_m: Reach of the grid around the LiDAR in metres; beyond the local area nothing is known.
        cell_m: Edge of a cell in metres.
    """

    reach_m: float = 20.0
    cell_m: float = 0.2


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
    states, points = result.obstacles.point_states, result.frame.points_velo
    pose, ground = result.world_SE3_velo, points[states == PointState.GROUND]
    is_moving = states == PointState.MOVING
    obstacles = points[is_moving | (states == PointState.STATIC)]
    height_m = _height_m(ground)
    frame = _CellFrame.around(pose, config)
    is_free = _free_cells(frame, ground, obstacles, height_m)
    # Static places of earlier scans, as far as nothing is seen there now.
    occupied = frame.holds(result.obstacles.static.centers_m) & ~is_free & ~frame.holds(points)
    is_marked = states == PointState.STATIC
    is_marked |= is_moving if with_moving else False
    marked = points[is_marked]
    occupied |= frame.holds(marked[result.ground.distance_m(marked) >= _MIN_OBSTACLE_M])
    # What is lower may be a kerb: neither free nor occupied.
    is_doubtful = cv2.dilate((occupied | frame.holds(marked)).astype(np.uint8), _MARGIN) > 0
    grid = np.full(is_free.shape, UNKNOWN, np.int8)
    grid[is_free & ~is_doubtful] = FREE
    grid[occupied] = OCCUPIED
    below_m = height_m if np.isfinite(height_m) else 0.0
    origin_m = np.append(frame.offset_m + pose[:2, 3], pose[2, 3] - below_m)
    return OccupancyGrid(grid, origin_m, config.cell_m)


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

    def xy_m(self, points_velo: Float32) -> Float64:
        """Return (N, 2) positions of points from the LiDAR."""
        return np.asarray(points_velo[:, :3] @ self.rotation.T, np.float64)

    def holds(self, points_velo: Float32) -> Bool:
        """Return (H, W) which cells hold at least one of (N, 3+) points."""
        cells = np.floor((self.xy_m(points_velo) - self.offset_m) / self.cell_m).astype(np.int64)
        column, row = cells.T
        is_inside = (np.minimum(row, column) >= 0) & (np.maximum(row, column) < self.count)
        found = np.zeros((self.count, self.count), bool)
        found[row[is_inside], column[is_inside]] = True
        return found

    def centers_m(self) -> Float64:
        """Return (H * W, 2) centres of the cells from the LiDAR."""
        steps = self.cell_m * (np.arange(self.count) + 0.5)
        x, y = np.meshgrid(self.offset_m[0] + steps, self.offset_m[1] + steps)
        return np.stack([x.ravel(), y.ravel()], axis=1)


def _height_m(ground_velo: Float32) -> float:
    """Return the height of the LiDAR above the returns of the ground nearby."""
    near = ground_velo[np.hypot(ground_velo[:, 0], ground_velo[:, 1]) < 10.0]
    chosen = near if len(near) else ground_velo
    return max(-float(np.median(chosen[:, 2])), _MIN_OBSTACLE_M) if len(chosen) else np.inf


def _free_cells(
    frame: _CellFrame, ground_velo: Float32, obstacles_velo: Float32, height_m: float
) -> Bool:
    """Return (H, W) which cells beams passed low on their way to the ground."""
    bins, cell_m = int(np.ceil(0.75 * frame.count)), frame.cell_m
    ranges_m, sectors = _polar(frame.xy_m(ground_velo))
    # What lies behind an obstacle of the sector is not free, although a beam of its edge may have passed.
    limits_m = np.full(_SECTORS, np.inf)
    obstacle_ranges_m, obstacle_sectors = _polar(frame.xy_m(obstacles_velo))
    np.minimum.at(limits_m, obstacle_sectors, obstacle_ranges_m)
    is_seen = ranges_m < limits_m[sectors]
    ranges_m, sectors = ranges_m[is_seen], sectors[is_seen]
    first = ranges_m * max(1 - _MIN_OBSTACLE_M / height_m, 0) / cell_m
    # Passes begin and end at bins of the range, and are counted from the LiDAR outwards.
    steps = np.zeros((_SECTORS, bins + 1), np.int32)
    np.add.at(steps, (sectors, np.minimum(first.astype(np.int64), bins)), 1)
    np.add.at(steps, (sectors, np.minimum((ranges_m / cell_m).astype(np.int64) + 1, bins)), -1)
    is_passed = np.cumsum(steps, axis=1) > 0
    is_passed[:, bins] = False
    cell_ranges_m, cell_sectors = _polar(frame.centers_m())
    places = np.minimum((cell_ranges_m / cell_m).astype(np.int64), bins)
    return np.asarray(is_passed[cell_sectors, places].reshape(frame.count, frame.count))


def _polar(xy_m: Float64) -> tuple[Float64, NDArray[np.int64]]:
    """Return (N,) ranges in metres and sectors of (N, 2) positions."""
    angles = np.arctan2(xy_m[:, 1], xy_m[:, 0]) * (_SECTORS / (2 * np.pi))
    return np.hypot(xy_m[:, 0], xy_m[:, 1]), np.floor(angles).astype(np.int64) % _SECTORS
