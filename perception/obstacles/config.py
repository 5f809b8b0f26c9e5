"""Configuration of the obstacle stages: the ground, and static and moving obstacles (thesis 5.1, Table 7.1)."""

from dataclasses import dataclass, field

import numpy as np

from perception.errors import UsageError
from perception.types import Method

_MAX_CELLS = 1000  # to each side of an occupancy grid


@dataclass(frozen=True)
class GroundSurfaceConfig:
    """Default ground: one smooth surface, fitted robustly from coarse to fine.

    Attributes:
        cell_m: Distance between two nodes of the surface in metres.
        max_points: Largest number of points of a scan that are used; scans with more are thinned evenly.
        remembered_scans: Number of earlier scans that fill gaps of the newest.
        rounds: Number of fits of the flexible surface, each with less weight for what was far from the last one.
    """

    cell_m: float = 1.0
    max_points: int = 65_000
    remembered_scans: int = 4
    rounds: int = 2

    def __post_init__(self) -> None:
        """Validate sizes and counts."""
        if min(self.cell_m, self.max_points, self.rounds) <= 0 or self.remembered_scans < 0:
            raise UsageError(
                "ground surface", expected="positive sizes and counts", found=str(self)
            )


@dataclass(frozen=True)
class PiecewisePlanesConfig:
    """Ground of the thesis: planes over slices of the road ahead, by RANSAC (5.1.2, Algorithm 3).

    Attributes:
        first_edge_m: Radius of the first slice in metres (λ0, 5.1.2).
        steps_per_slice: Number of elevation steps of the sensor in a slice (η, Table 7.1).
        iterations: Number of RANSAC iterations (open in the thesis).
        inlier_m: Largest distance of a RANSAC inlier from the plane in metres (open in the thesis).
        subsample: Number of points of a slice that RANSAC uses (open in the thesis).
        max_angle_rad: Largest angle in rad between neighbouring planes (τ, Table 7.1: 10 degrees).
        max_step_m: Largest step in metres between neighbouring planes at their common edge (ℓ, Table 7.1).
    """

    # 100 iterations find a clean triple among 70 % outliers with 93 %; an inlier lies within 2.5 range noises.
    first_edge_m: float = 5.0
    steps_per_slice: int = 6
    iterations: int = 100
    inlier_m: float = 0.05
    subsample: int = 1000
    max_angle_rad: float = float(np.radians(10))
    max_step_m: float = 0.10

    def __post_init__(self) -> None:
        """Validate that there is a slice and a sample."""
        positive = (self.first_edge_m, self.steps_per_slice, self.iterations, self.inlier_m)
        if min(positive) <= 0 or self.subsample < 3:
            raise UsageError(
                "ground planes",
                expected="positive values and a subsample of at least 3",
                found=str(self),
            )


@dataclass(frozen=True)
class GroundConfig:
    """Ground estimation.

    Attributes:
        method: Method of this stage; else that of the pipeline.
        surface: Smooth surface, the default.
        planes: Piecewise planes, the method of the thesis.
    """

    method: Method | None = None
    surface: GroundSurfaceConfig = field(default_factory=GroundSurfaceConfig)
    planes: PiecewisePlanesConfig = field(default_factory=PiecewisePlanesConfig)


@dataclass(frozen=True)
class FreeSpaceConfig:
    """Default static-moving segmentation: a place is moving where earlier beams passed through it.

    Attributes:
        min_ground_distance_m: Smallest distance of an obstacle point from the ground in metres (d_min).
        horizon_s: Age of the oldest queried scan in seconds.
        min_voxels: Smallest number of voxels of a moving cluster that appeared in free space.
        memory_scans: Number of scans for which a static voxel is kept without being observed (n).
    """

    # On a surface good to 5 cm, 15 cm clear kerbs and three range noises (the thesis' planes need 20 cm). A pedestrian
    # at 0.5 m/s takes 1.5 s to leave his own place. Fewer than 10 voxels may be glass that returns only now and then.
    min_ground_distance_m: float = 0.15
    horizon_s: float = 1.5
    min_voxels: int = 10
    memory_scans: int = 6


@dataclass(frozen=True)
class MotionCountersConfig:
    """Static-moving segmentation of the thesis: occupancy counters of ground cells (5.1.3, Table 7.1).

    Attributes:
        min_ground_distance_m: Smallest distance of an obstacle point from the ground in metres (d_min, Table 7.1).
        static_threshold: Smallest number of points of a static column (T_s, Table 7.1: 50 for m = 6 and an HDL-64E);
            where none is given, in proportion to the merged scans and to the sensor's points a scan.
        moving_threshold: Smallest number of points of a moving column (T_d, Table 7.1).
    """

    min_ground_distance_m: float = 0.2
    static_threshold: int | None = None
    moving_threshold: int = 5


@dataclass(frozen=True)
class MotionConfig:
    """Static-moving segmentation of the points above the ground.

    Attributes:
        method: Method of this stage; else that of the pipeline.
        voxel_size_m: Edge of a voxel in metres (υ, Table 7.1).
        previous_scans: Number of scans before the newest that the methods of the thesis merge (m, Table 7.1).
        free_space: Free-space test, the default.
        counters: Occupancy counters, the method of the thesis.
    """

    method: Method | None = None
    voxel_size_m: float = 0.1
    previous_scans: int = 6
    free_space: FreeSpaceConfig = field(default_factory=FreeSpaceConfig)
    counters: MotionCountersConfig = field(default_factory=MotionCountersConfig)

    def __post_init__(self) -> None:
        """Validate the voxel size, and that the window has a history."""
        if not self.voxel_size_m > 0:
            raise UsageError("voxel_size_m", expected="above 0", found=str(self.voxel_size_m))
        if self.previous_scans < 1:
            raise UsageError(
                "previous_scans", expected="at least 1", found=str(self.previous_scans)
            )


@dataclass(frozen=True)
class OccupancyConfig:
    """Occupancy grid.

    Attributes:
        reach_m: Reach of the grid around the LiDAR in metres; beyond the local area nothing is known.
        cell_m: Edge of a cell in metres.
        rate_hz: Number of grids a second on topics of ROS 2, at most one a scan; a run writes one a scan.
    """

    reach_m: float = 20.0
    cell_m: float = 0.2
    rate_hz: float = 5.0

    def __post_init__(self) -> None:
        """Validate that there are cells, no more than a planner takes, and a rate."""
        if not (0 < self.cell_m <= self.reach_m <= _MAX_CELLS * self.cell_m and self.rate_hz > 0):
            raise UsageError(
                "occupancy grid",
                expected=f"positive values, and a reach of 1 to {_MAX_CELLS} cells",
                found=str(self),
            )
