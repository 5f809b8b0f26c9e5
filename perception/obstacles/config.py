"""Configuration of the obstacle stages: the ground, and static and moving obstacles (thesis 5.1, Table 7.1)."""

from dataclasses import dataclass, field

import numpy as np

from perception.errors import UsageError
from perception.types import Method


@dataclass(frozen=True)
class GroundSurfaceConfig:
    """Default ground: one smooth surface, fitted robustly from coarse to fine.

    Attributes:
        margin_m: Reach of the surface beyond the local area in metres.
        cell_m: Distance between two nodes of the surface in metres.
        max_cells_across: Largest number of cells across the road; in a wider area nodes are farther apart.
        sample_m: Edge of the cells in metres in which points are averaged.
        max_points: Largest number of points of a scan that are used; scans with more are thinned evenly.
        max_slope: Largest mean slope of the ground seen from the sensor, as a ratio.
        max_step_m: Largest difference in metres between the sensor's mounting height and its height over the ground.
        stiffness: Stiffness of the first, coarse surface.
        fine_stiffness: Stiffness of the second, fine surface.
        stiff_scales_m: Scales of the robust fit of the coarse surface in metres, round by round.
        scales_m: Scales of the robust fit of the fine surface in metres, round by round.
        low_scale_ratio: Scale below the surface relative to that above: low points are ground rather than obstacle.
        band_m: Largest distance in metres from the coarse surface of a point that may be ground.
        full_count: Number of points from which on a cell's average has full weight.
        obstacle_band_m: Lowest and highest height in metres of points that make a cell unfit for the memory.
        remembered_scans: Number of earlier scans that fill gaps of the newest.
        remember_every: Number of scans from one remembered scan to the next.
        memory_weight: Weight of remembered averages, against 1 of new ones.
    """

    # Measured on real drives. The stiffness belongs to nodes twice as far apart: 25 there is 100 here.
    margin_m: float = 3.0
    cell_m: float = 1.0
    max_cells_across: int = 60
    sample_m: float = 0.5
    max_points: int = 65_000
    max_slope: float = 0.15
    max_step_m: float = 0.5
    stiffness: float = 25.0
    fine_stiffness: float = 0.3
    stiff_scales_m: tuple[float, ...] = (0.3, 0.15, 0.1)
    scales_m: tuple[float, ...] = (0.15, 0.15)
    low_scale_ratio: float = 2.0
    band_m: float = 0.20
    full_count: int = 5
    obstacle_band_m: tuple[float, float] = (0.3, 1.5)
    remembered_scans: int = 4
    remember_every: int = 3
    memory_weight: float = 0.3

    def __post_init__(self) -> None:
        """Validate sizes and counts."""
        lengths = (self.cell_m, self.sample_m, self.band_m)
        counts = (self.max_cells_across, self.max_points, self.full_count)
        if min(*lengths, *counts) <= 0 or self.remembered_scans < 0 or self.remember_every < 1:
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
        refits: Whether the best plane is fitted again to all its inliers (not in the thesis).
        max_angle_rad: Largest angle in rad between neighbouring planes (τ, Table 7.1: 10 degrees).
        max_step_m: Largest step in metres between neighbouring planes at their common edge (ℓ, Table 7.1).
        max_first_step_m: Largest distance in metres of the first plane from level ground below the sensor (not in
            the thesis).
    """

    # 100 iterations find a clean triple among 70 % outliers with 93 %; an inlier lies within 2.5 range noises. The
    # thesis does not check its first plane: a car beside the sensor can tip it on its side.
    first_edge_m: float = 5.0
    steps_per_slice: int = 6
    iterations: int = 100
    inlier_m: float = 0.05
    subsample: int = 1000
    refits: bool = True
    max_angle_rad: float = float(np.radians(10))
    max_step_m: float = 0.10
    max_first_step_m: float = 0.5

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
        max_travel_m: Largest distance in metres that the vehicle may have moved since that scan.
        margin_m: Largest difference in range in metres of two returns from one surface.
        memory_scans: Number of scans for which a static voxel is kept without being observed (n).
    """

    # On a surface good to 5 cm, 15 cm clear kerbs and three range noises (the thesis' planes need 20 cm). A pedestrian
    # at 0.5 m/s takes 1.5 s to leave his own place. Seen from more than 12 m farther back, a post of 10 cm at the end
    # of the area falls between two beams. 20 cm are range noise, a pose error of 5 cm and the slant of a surface within
    # a pixel.
    min_ground_distance_m: float = 0.15
    horizon_s: float = 1.5
    max_travel_m: float = 12.0
    margin_m: float = 0.2
    memory_scans: int = 6


@dataclass(frozen=True)
class MovingClusterConfig:
    """Decision of the default method which clusters of voxels are moving.

    Attributes:
        cell_m: Edge in metres of the ground cells in which voxels are joined to clusters.
        gap_ratio: Largest distance over the ground between two parts of an object, relative to that of two beams there.
        min_voxels: Smallest number of voxels of a moving cluster that appeared in free space.
        min_voxels_near_moving: The same next to voxels that moved in the scan before.
        near_moving_m: Largest distance in metres to voxels that moved in the scan before; 0.5 m is 5 m/s at 10 Hz.
        min_appeared_ratio: Smallest share of a moving cluster's voxels that appeared in free space, 0 to 1.
        min_observations: Smallest number of observations of its voxels that appeared, over the scans of the horizon, of
            a cluster that begins to move.
        min_solid_voxels: Number of voxels that appeared from which on a cluster is no part of a fence or hedge around.
        max_returned_ratio: Largest share of the scans of the horizon, of those that saw a place that appeared, with a
            return from it before another beam passed: more is a fence or leaves, 0 to 1.
        max_returned_ratio_near_moving: The same next to voxels that moved in the scan before.
        stopped_ratio: Share of a cluster's visible voxels that the youngest queried scan has hit as well, from which
            on the cluster is static again, 0 to 1.
        stop_age_s: Smallest age in seconds of a scan that can tell standing from walking.
        clear_age_s: Age in seconds after which a pedestrian at 1 m/s no longer overlaps his earlier place.
        departed_gap_m: Largest distance in metres, extrapolated to now, between a cluster and the departed object
            before it that is the cluster itself.
        departed_gap_ratio: The same at a steady speed, relative to that distance when it was observed last.
        departed_acceleration_m_s2: Acceleration in m/s² that is allowed beside; half of that distance always is too far.
        whole_object_ratio: Share of an object's voxels that move from which on all of it moves, 0 to 1.
        whole_vehicle_m: Length in metres of the moving part of an object from which on it is a vehicle, not a person.
        person_margin_m: Largest distance in metres from the moving part of a person to the rest.
    """

    # Fewer than 10 voxels may be glass that returns only now and then. Cells of 25 cm keep a pedestrian's legs together.
    # On a surface that leans by 30 degrees, returns are twice as far apart as the beams.
    cell_m: float = 0.25
    gap_ratio: float = 2.0
    min_voxels: int = 10
    min_voxels_near_moving: int = 4
    near_moving_m: float = 0.5
    min_appeared_ratio: float = 0.1
    min_observations: int = 40
    min_solid_voxels: int = 30
    max_returned_ratio: float = 0.1
    max_returned_ratio_near_moving: float = 0.2
    stopped_ratio: float = 0.95
    stop_age_s: float = 0.3
    clear_age_s: float = 0.5
    departed_gap_m: float = 1.0
    departed_gap_ratio: float = 0.25
    departed_acceleration_m_s2: float = 2.0
    whole_object_ratio: float = 0.5
    whole_vehicle_m: float = 2.0
    person_margin_m: float = 0.3


@dataclass(frozen=True)
class RigidBodyConfig:
    """Motion of bodies of which most fills the place that it filled before, by the default method.

    Attributes:
        min_voxels: Smallest number of voxels of a body that were not there before.
        min_body_voxels: Smallest number of voxels of a body; smaller ones leave their place soon.
        min_length_m: Smallest length of a body in metres, the width of a lorry's rear.
        max_length_m: Largest length of a body in metres.
        long_m: Length in metres from which on a body moves along its longer axis only.
        min_distance_m: Smallest distance in metres that a body has come since the oldest queried scan.
        max_distance_m: Largest distance in metres; a body that came farther left its place.
        max_speed_m_s: Largest speed of a body in m/s, while the history is short.
        step_m: Difference in metres of two distances that are tried.
        samples: Largest number of voxels that are compared with the earlier scan, of each end and of the whole body.
        max_width_m: Largest width of a body in metres, that of a lorry with its mirrors; of a wider cluster, only what is
            in line with what appeared is a body.
        side_margin_m: Largest distance in metres to the side of what appeared in a wider cluster.
        min_explained_ratio: Smallest share of a body's visible voxels that the earlier scan hit where they came from.
        min_gain_ratio: Smallest share by which more voxels are explained than of a static body.
        end_m: Largest length of a front or rear in metres.
        min_end_voxels: Smallest number of voxels of a front that appeared, or of a rear that left free space.
        min_end_ratio: Smallest share of these in the front or rear, 0 to 1.
        min_moved_before_ratio: Smallest share of a body that moved in the scan before, 0 to 1, with which it goes on without
            an end that shows.
        max_taken_ratio: Largest share of the places of the rear of then at which the newest scan has returns, 0 to 1.
        speeds_on_the_way: First, last and step of the speeds since the younger queried scans that are tried, as shares of
            the mean speed since the oldest.
        min_width_m: Smallest width of a body in metres; a thinner one must hide what is as far behind it.
        max_length_per_width: Largest ratio of length to width of a body; a longer one counts as thinner, too.
        min_hidden_ratio: Smallest share of the places behind a thinner one that it hides, 0 to 1.
        min_came_m: Smallest distance in metres that a body at a steady speed came since a younger scan that tells whether
            it has stopped.
        stopped_ratio: Smallest ratio of the voxels of its ends that this scan shows in their places to those that it shows
            on their way, of a body that has stopped.
    """

    # A tram of two parts has 22 m. Steps of 0.3 m are within the margin of a hit on both sides. What came less than
    # almost twice that margin is hit where it is in either case.
    min_voxels: int = 10
    min_body_voxels: int = 100
    min_length_m: float = 2.0
    max_length_m: float = 24.0
    long_m: float = 5.0
    min_distance_m: float = 0.3
    max_distance_m: float = 8.0
    max_speed_m_s: float = 30.0
    step_m: float = 0.3
    samples: int = 24
    max_width_m: float = 3.2
    side_margin_m: float = 0.3
    min_explained_ratio: float = 0.9
    min_gain_ratio: float = 0.05
    end_m: float = 1.5
    min_end_voxels: int = 5
    min_end_ratio: float = 0.5
    min_moved_before_ratio: float = 0.5
    max_taken_ratio: float = 0.3
    min_width_m: float = 0.5
    max_length_per_width: float = 10.0
    min_hidden_ratio: float = 0.5
    min_came_m: float = 0.35
    stopped_ratio: float = 2.0
    speeds_on_the_way: tuple[float, float, float] = (0.4, 1.7, 0.1)


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
        moving_clusters: Decision which clusters are moving, by the default method.
        rigid_bodies: Motion of long bodies, by the default method.
        counters: Occupancy counters, the method of the thesis.
    """

    method: Method | None = None
    voxel_size_m: float = 0.1
    previous_scans: int = 6
    free_space: FreeSpaceConfig = field(default_factory=FreeSpaceConfig)
    moving_clusters: MovingClusterConfig = field(default_factory=MovingClusterConfig)
    rigid_bodies: RigidBodyConfig = field(default_factory=RigidBodyConfig)
    counters: MotionCountersConfig = field(default_factory=MotionCountersConfig)

    def __post_init__(self) -> None:
        """Validate the voxel size, and that the window has a history."""
        if not self.voxel_size_m > 0:
            raise UsageError("voxel_size_m", expected="above 0", found=str(self.voxel_size_m))
        if self.previous_scans < 1:
            raise UsageError(
                "previous_scans", expected="at least 1", found=str(self.previous_scans)
            )
