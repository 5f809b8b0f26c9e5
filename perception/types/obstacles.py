"""The ground, and static and moving obstacles on it."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

from perception.types.table import Float, Float32, Float64, Int, UInt8, require_shape


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
