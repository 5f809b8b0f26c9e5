"""The ground, and static and moving obstacles on it."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from perception.types.table import Float, Float32, Float64, Int, UInt8, require_shape

# Of a cell, as of nav_msgs/OccupancyGrid.
UNKNOWN: Final = -1
FREE: Final = 0
OCCUPIED: Final = 100


class GroundModel(Protocol):
    """A ground surface in the LiDAR frame, which every ground method returns."""

    def height_m(self, xy_m: Float) -> Float64:
        """Return (N,) the z of the ground at (N, 2) positions."""
        ...

    def distance_m(self, points_velo: Float) -> Float:
        """Return (N,) signed distances of (N, 3+) points along the ground's normal, up positive."""
        ...


class PointState(IntEnum):
    """Class of one LiDAR point."""

    OUTSIDE = 0  # beyond the local area
    GROUND = 1
    STATIC = 2
    MOVING = 3


@dataclass(frozen=True)
class Voxels:
    """V occupied voxels of one grid.

    Attributes:
        centers_m: (V, 3) centres of the voxels.
        counts: (V,) points in each, the thesis' occupancy value (2.1.2).
        size_m: Edge of a voxel in metres.
    """

    centers_m: Float32
    counts: Int
    size_m: float

    def __post_init__(self) -> None:
        """Validate shapes and lengths."""
        require_shape("Voxels.centers_m", self.centers_m, ("V", 3))
        require_shape("Voxels.counts", self.counts, (len(self.centers_m),))

    def __len__(self) -> int:
        """Return V."""
        return len(self.centers_m)


@dataclass(frozen=True)
class Obstacles:
    """Obstacles of one scan, in the LiDAR frame of that scan.

    Attributes:
        point_states: (N,) one `PointState` for each point of the frame.
        static: Voxels of the static map, observed in this scan or a recent one.
        moving: Moving voxels of this scan.
    """

    point_states: UInt8
    static: Voxels
    moving: Voxels


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
