"""Configuration of the trackers of one object: box fit (the default), the thesis' fusion (Table 7.5), and baselines."""

import math
from dataclasses import dataclass, field
from typing import Literal

from perception.errors import UsageError

TrackerName = Literal[
    "default",
    "h-fus",
    "l-fus",
    "3d-ms",
    "3d-kf",
    "ms-i",
    "cbwh",
    "opencv-mil",
    "opencv-kcf",
    "opencv-csrt",
]


@dataclass(frozen=True)
class FilterNoiseConfig:
    """Noise of a constant-acceleration Kalman filter; Q, R and P0 are multiples of the identity matrix.

    Attributes:
        process: Factor of Q, added every 0.1 s.
        initial: Factor of P0.
        measurement: Factor of R.
    """

    process: float = 3.0
    initial: float = 1.0
    measurement: float = 1.0


@dataclass(frozen=True)
class PitchGroundConfig:
    """Ground plane that pitches with the vehicle (5.3.2); values of the author's code.

    Attributes:
        min_ahead_m: Minimum distance ahead of points that are used; nearer, centimetres are degrees.
        max_side_m: Maximum distance to the side of points that are used.
        height_range_m: Range of heights of points that are used, above the level under the wheels.
        gate_rad: Maximum difference from the predicted pitch; increased by itself with each miss.
        bin_rad: Width of a bin of the angles' density (5.10).
        max_pitch_rad: Maximum angle of a point above or below the level under the wheels.
        min_peak: Minimum height and prominence of a peak of the density, in those of the highest.
        noise: Noise of the filter of the pitch, in deg².
    """

    min_ahead_m: float = 4.0
    max_side_m: float = 20.0
    height_range_m: tuple[float, float] = (-0.5, 2.0)
    gate_rad: float = math.radians(0.3)
    bin_rad: float = math.radians(0.01)
    max_pitch_rad: float = math.radians(12.0)
    min_peak: float = 0.25
    noise: FilterNoiseConfig = field(
        default_factory=lambda: FilterNoiseConfig(process=5.0, initial=15.0, measurement=0.5)
    )


@dataclass(frozen=True)
class CourseConfig:
    """Heading from the course of a point (5.3.4): a turn of a slow object is noise; the author's values.

    Attributes:
        vehicle_volume_m3: Minimum volume of a box that is a vehicle; smaller ones are pedestrians and cyclists.
        slow_m_s: Maximum speed of a slow pedestrian or cyclist.
        max_turn_rad: Maximum turn of a slow pedestrian or cyclist between two scans.
        slow_vehicle_m_s: Maximum speed of a slow vehicle.
        max_vehicle_turn_rad: Maximum turn of a slow vehicle between two scans.
    """

    vehicle_volume_m3: float = 4.0
    slow_m_s: float = 0.5
    max_turn_rad: float = 0.4
    slow_vehicle_m_s: float = 4.0
    max_vehicle_turn_rad: float = 0.15


@dataclass(frozen=True)
class CentroidTrackerConfig:
    """Tracking loop of all trackers that track a point of the object: H-Fus, L-Fus, 3D-MS and 3D-KF.

    Attributes:
        ground: Ground model: the thesis' pitching plane, or that of the obstacle stage.
        pitch: Pitching plane.
        min_height_m: Minimum height above the ground of the object's points (d_min, Table 7.5).
        headroom_m: Maximum height of the object's points above the top of its box.
        gate: Length and width of the gate around the predicted position, in those of the box (App. A).
        lost_after_s: Time without an observation after which the object is lost.
        max_gap_s: Maximum time between two scans of one drive.
        motion: Noise of the filter of the motion (5.17), in m²; values of the author's code.
        course: Heading from the course.
    """

    ground: Literal["pitch", "stage"] = "pitch"
    pitch: PitchGroundConfig = field(default_factory=PitchGroundConfig)
    min_height_m: float = 0.20
    headroom_m: float = 0.5
    gate: float = 2.0
    lost_after_s: float = 1.0
    max_gap_s: float = 1.0
    motion: FilterNoiseConfig = field(default_factory=FilterNoiseConfig)
    course: CourseConfig = field(default_factory=CourseConfig)


@dataclass(frozen=True)
class PointMeanShiftConfig:
    """Mean shift of a window over the points (5.3.2).

    Attributes:
        max_iterations: Maximum number of shifts (η, Table 7.5).
        tolerance_m: Shift below which the window has converged (δℓ, Table 7.5).
    """

    max_iterations: int = 5
    tolerance_m: float = 0.05


@dataclass(frozen=True)
class ImageMeanShiftConfig:
    """Mean shift of a region in the image (5.3.3).

    Attributes:
        max_iterations: Maximum number of shifts (η', Table 7.5).
        tolerance_px: Shift below which the region has converged (δℓ', Table 7.5).
    """

    max_iterations: int = 4
    tolerance_px: float = 1.0


@dataclass(frozen=True)
class ColorModelConfig:
    """Colour model of an object against its surroundings, and its filters (5.3.3).

    Attributes:
        bins_per_channel: Number of bins per colour channel: 2, 4, 8 or 16 (b, Table 7.5).
        ring_scale: Length of the ring's outline relative to the object's outline; the root of 2 makes the ring as
            large as the object (Ω†, Table 7.5).
        noise: Noise of the filter of each bin; values of the author's code.
    """

    bins_per_channel: int = 8
    ring_scale: float = math.sqrt(2)
    noise: FilterNoiseConfig = field(default_factory=lambda: FilterNoiseConfig(process=0.1))

    @property
    def bins(self) -> int:
        """Number of bins of all colours."""
        return self.bins_per_channel**3

    def __post_init__(self) -> None:
        """Validate the number of bins and the ring."""
        if self.bins_per_channel not in (2, 4, 8, 16):
            raise UsageError(
                "colour model",
                expected="2, 4, 8 or 16 bins per channel",
                found=str(self.bins_per_channel),
            )
        if self.ring_scale <= 1:
            raise UsageError(
                "colour model", expected="a ring scale above 1", found=str(self.ring_scale)
            )


@dataclass(frozen=True)
class FusionTrackerConfig:
    """The thesis' fusion tracker H-Fus (5.3): LiDAR and camera each locate the object, a filter fuses both.

    The variances are those of the author's later trials, which trust the scan more. With his first ones
    (process 1, scan and image 5), the fused point lags behind an object that accelerates.

    Attributes:
        points: Mean shift in the scan.
        image: Mean shift in the image.
        colors: Colour model.
        process: Factor of Q of the fusing filter (5.15), added every 0.1 s.
        initial: Factor of P0 of the fusing filter.
        lidar_variance: Variance of a position located in the scan (5.16), in m².
        image_variance: Variance of a position located in the image (5.16), in m².
        depth_window: Size of the window whose points give the depth of an image position, in boxes.
    """

    points: PointMeanShiftConfig = field(default_factory=PointMeanShiftConfig)
    image: ImageMeanShiftConfig = field(default_factory=ImageMeanShiftConfig)
    colors: ColorModelConfig = field(default_factory=ColorModelConfig)
    process: float = 3.0
    initial: float = 1.0
    lidar_variance: float = 1.0
    image_variance: float = 3.0
    depth_window: float = 2.0


@dataclass(frozen=True)
class HistogramTrackerConfig:
    """Mean shift on colour histograms in the image, of MS-I and CBWH (7.1.2).

    Attributes:
        max_iterations: Maximum number of shifts.
        tolerance_px: Shift below which the window has converged.
    """

    max_iterations: int = 15
    tolerance_px: float = 0.1


@dataclass(frozen=True)
class BaselinesConfig:
    """Trackers that the fusion tracker is compared with (7.1.2, App. A).

    Attributes:
        mean_shift: Mean shift of 3D-MS; three shifts are its best (App. A.1).
        colored_points: Mean shift of L-Fus.
        histogram: Mean shift in the image of MS-I and CBWH.
        max_missed: Maximum number of consecutive frames without the object of a tracker in the image alone, after
            which it is lost.
    """

    mean_shift: PointMeanShiftConfig = field(
        default_factory=lambda: PointMeanShiftConfig(max_iterations=3)
    )
    colored_points: PointMeanShiftConfig = field(default_factory=PointMeanShiftConfig)
    histogram: HistogramTrackerConfig = field(default_factory=HistogramTrackerConfig)
    max_missed: int = 10


@dataclass(frozen=True)
class TurnRateMotionConfig:
    """Constant turn rate and velocity of a vehicle or a cyclist; standard deviations.

    Attributes:
        acceleration_m_s2: Acceleration along the heading.
        lateral_speed_m_s: Velocity across the heading, constant for one scan.
        turn_rate_rad_s: Rate at which the heading turns.
        turn_time_constant_s: Time after which a turn has decayed to a third.
        full_turn_speed_m_s: Speed below which the turn rate decreases.
        initial_speed_m_s: Initial speed.
        initial_turn_rate_rad_s: Initial turn rate.
        axle_share: Distance from the rear axle to the middle, as a share of the length.
        may_reverse: Whether the object may move against its heading.
        min_speed_m_s: Backward speed above which an object that may not reverse is turned round.
    """

    acceleration_m_s2: float = 3.0
    lateral_speed_m_s: float = 0.15
    turn_rate_rad_s: float = 0.35
    turn_time_constant_s: float = 1.5
    full_turn_speed_m_s: float = 2.0
    initial_speed_m_s: float = 7.0
    initial_turn_rate_rad_s: float = 0.2
    axle_share: float = 0.3
    may_reverse: bool = True
    min_speed_m_s: float = 0.4


@dataclass(frozen=True)
class WalkerMotionConfig:
    """Constant velocity of a pedestrian; standard deviations.

    Attributes:
        acceleration_m_s2: Acceleration along x and along y.
        acceleration_time_s: Duration of an acceleration.
        turn_rate_rad_s: Change of the heading within a second while walking.
        static_turn_rate_rad_s: Change of the heading within a second while standing.
        initial_speed_m_s: Initial velocity along x and along y.
        course_deviation_rad: Deviation of the heading from the course.
        min_speed_m_s: Minimum speed at which the course corrects the heading.
    """

    acceleration_m_s2: float = 1.5
    acceleration_time_s: float = 0.1
    turn_rate_rad_s: float = 0.6
    static_turn_rate_rad_s: float = 0.1
    initial_speed_m_s: float = 1.2
    course_deviation_rad: float = 0.3
    min_speed_m_s: float = 0.4


@dataclass(frozen=True)
class ObjectMotionConfig:
    """Motion model of an object, by the size of its box.

    Attributes:
        vehicle: Motion of vehicles.
        cyclist: Motion of cyclists, which are neither vehicles nor pedestrians.
        walker: Motion of pedestrians.
        min_vehicle_m: Minimum length and width of a vehicle.
        max_walker_m: Maximum length of a pedestrian.
        max_step_s: Maximum time of one prediction step.
    """

    vehicle: TurnRateMotionConfig = field(default_factory=TurnRateMotionConfig)
    cyclist: TurnRateMotionConfig = field(
        default_factory=lambda: TurnRateMotionConfig(
            acceleration_m_s2=2.0,
            lateral_speed_m_s=0.25,
            turn_rate_rad_s=0.6,
            turn_time_constant_s=1.0,
            full_turn_speed_m_s=1.0,
            initial_speed_m_s=4.0,
            initial_turn_rate_rad_s=0.3,
            axle_share=0.2,
            may_reverse=False,
        )
    )
    walker: WalkerMotionConfig = field(default_factory=WalkerMotionConfig)
    min_vehicle_m: tuple[float, float] = (2.4, 1.2)
    max_walker_m: float = 1.3
    max_step_s: float = 0.15


@dataclass(frozen=True)
class ObjectShapeConfig:
    """Reward of a point by its position in the object's frame.

    Attributes:
        cell_m: Edge of a cell of the reward map.
        rim_share: Width of the rim outside the box in which points count against it, as a share of its width.
        rim_m: Minimum and maximum width of the rim.
        own_share: Margin outside the box beyond which points belong to the background, as a share of its width.
        own_m: Minimum and maximum of that margin.
        side_deviation_m: Standard deviation of points from the side they lie on.
        deep_reward: Reward of a point inside, far from the sides that face the sensor.
        rim_penalty: Penalty of a point outside.
        tolerance_m: Distance outside the box up to which a point counts for it.
        edge_m: Width over which the reward falls to the penalty.
        vehicle_width_m: Minimum width of an object that has sides; narrower bodies have a middle.
        near_share: Distance of a body's points from its middle towards the sensor, as a share of its width.
        spread_share: Spread of a body's points, as a share of its length and width.
        memory_share: Share of the reward that comes from past observations, after many scans.
        memory_scans: Number of scans after which half of that share is reached.
        memory_fading: Share of the past observations that one more scan replaces.
        blur_m: Blur of the past observations.
        own_reward: Minimum reward of a point that is the object's.
    """

    cell_m: float = 0.05
    rim_share: float = 0.5
    rim_m: tuple[float, float] = (0.35, 0.6)
    own_share: float = 0.3
    own_m: tuple[float, float] = (0.2, 0.4)
    side_deviation_m: float = 0.2
    deep_reward: float = 0.3
    rim_penalty: float = 0.7
    tolerance_m: float = 0.1
    edge_m: float = 0.15
    vehicle_width_m: float = 1.3
    near_share: float = 0.2
    spread_share: float = 0.25
    memory_share: float = 0.5
    memory_scans: float = 3.0
    memory_fading: float = 0.02
    blur_m: float = 0.08
    own_reward: float = 0.2


@dataclass(frozen=True)
class PoseSearchConfig:
    """Search of the pose that the points support best, coarse to fine.

    Attributes:
        coarse_steps: Maximum number of steps of the coarse lattice along the heading, across it, and in yaw.
        coarse_spacing: Spacing of the coarse lattice, as a share of the object's length and width.
        coarse_spacing_rad: Spacing of the coarse lattice in yaw.
        fine_steps: Numbers of steps of the finer lattices.
        reach: Half size of the coarse lattice, in standard deviations of the prediction.
        max_reach_m: Maximum half size of the coarse lattice.
        min_reach_m: Minimum half size of the coarse lattice along and across.
        min_reach_rad: Minimum half size of the coarse lattice in yaw.
        finest_m: Minimum half size of a finer lattice.
        finest_rad: Minimum half size of a finer lattice in yaw.
        saturation_points: Number of points beyond which more points add no information.
        sharpness: Log-likelihood of one point at the full reward.
        surplus_weight: Log-likelihood of e times the expected reward.
        max_points: Maximum number of points of one lattice; more are thinned out.
        score_margin: Maximum difference in log-likelihood of poses that are averaged.
        min_deviation_m: Minimum standard deviation of a position.
        min_deviation_rad: Minimum standard deviation of a yaw.
    """

    coarse_steps: tuple[int, int, int] = (25, 25, 7)
    coarse_spacing: float = 0.15
    coarse_spacing_rad: float = 0.07
    fine_steps: tuple[tuple[int, int, int], ...] = ((9, 9, 7), (7, 7, 7))
    reach: float = 2.5
    max_reach_m: float = 6.0
    min_reach_m: float = 0.25
    min_reach_rad: float = 0.06
    finest_m: float = 0.04
    finest_rad: float = 0.01
    saturation_points: float = 15.0
    sharpness: float = 3.0
    surplus_weight: float = 3.0
    max_points: int = 250
    score_margin: float = 6.0
    min_deviation_m: float = 0.03
    min_deviation_rad: float = 0.015


@dataclass(frozen=True)
class LocalGroundConfig:
    """Height of the ground below the object, from the ground stage or from the lowest points around.

    Attributes:
        cell_m: Edge of the cells of the lowest points.
        min_cells: Minimum number of cells with a lowest point near the expected height.
        around_m: Distance from the object within which lowest points are used.
        band_m: Maximum difference of a lowest point from the expected height.
        max_disagreement_m: Maximum difference between ground stage and lowest points at which the stage is used.
        slope: Standard deviation of the road's slope.
        drift_m: Standard deviation of the drift of the poses per scan.
        stage_deviation_m: Standard deviation of a height from the ground stage.
        lowest_deviation_m: Standard deviation of a height from the lowest points.
        lowest_above_m: Mean height of the lowest points above the ground.
    """

    cell_m: float = 0.5
    min_cells: int = 4
    around_m: float = 2.5
    band_m: float = 0.4
    max_disagreement_m: float = 0.2
    slope: float = 0.03
    drift_m: float = 0.01
    stage_deviation_m: float = 0.05
    lowest_deviation_m: float = 0.15
    lowest_above_m: float = 0.03


@dataclass(frozen=True)
class BackgroundConfig:
    """Background around the object, from the last scans.

    Attributes:
        cell_m: Edge of the cells.
        recent: Number of scans whose points beside the observed object are background.
        kept: Number of scans that are remembered.
        min_hidden: Minimum number of scans with a hidden object before static points are background.
        static_share: Share of these scans in which a static point is observed.
    """

    cell_m: float = 0.15
    recent: int = 4
    kept: int = 10
    min_hidden: int = 6
    static_share: float = 0.7


@dataclass(frozen=True)
class BoxFitTrackerConfig:
    """The default tracker of one object: its box is fitted to the points, scan by scan.

    Attributes:
        initial_deviation_m: Standard deviation of the initial box along x and y.
        initial_deviation_rad: Standard deviation of the initial yaw.
        clearance_m: Minimum height above the ground of the object's points.
        headroom_m: Maximum height of the object's points above the top of its box.
        cell_m: Edge of the cells that points are averaged over.
        search_margin_m: Minimum and maximum margin around the box within which points are used.
        background_weight: Weight of a point that lies on the background.
        min_reward: Minimum sum of rewards of an observed object; a point counts up to 1.
        min_contrast: Minimum ratio of rewards to penalties of an observed object.
        gate: Maximum squared Mahalanobis distance from the prediction; 11.3 holds 99 % of true poses (chi-squared,
            3 degrees of freedom).
        min_share: Minimum share of the expected reward of an observed object.
        reacquire_share: Minimum share of the expected reward of an object that was hidden.
        reacquire_top_m: Maximum change of the height of an object that was hidden, besides the beam spacing.
        lost_after_s: Time without an observation after which the object is lost.
        learning_rate: Gain of a correction of the expected reward and height.
        pose_drift: Standard deviation, in metres and radians, of the pose of a static object between two scans.
        motion: Motion model.
        shape: Reward of a point.
        search: Search of the pose.
        ground: Ground below the object.
        background: Background around the object.
    """

    initial_deviation_m: float = 0.1
    initial_deviation_rad: float = 0.08
    clearance_m: float = 0.2
    headroom_m: float = 0.3
    cell_m: float = 0.1
    search_margin_m: tuple[float, float] = (3.0, 6.0)
    background_weight: float = 0.1
    min_reward: float = 1.2
    min_contrast: float = 0.5
    gate: float = 11.3
    min_share: float = 0.1
    reacquire_share: float = 0.25
    reacquire_top_m: float = 0.25
    lost_after_s: float = 3.0
    learning_rate: float = 0.1
    pose_drift: float = 0.02
    motion: ObjectMotionConfig = field(default_factory=ObjectMotionConfig)
    shape: ObjectShapeConfig = field(default_factory=ObjectShapeConfig)
    search: PoseSearchConfig = field(default_factory=PoseSearchConfig)
    ground: LocalGroundConfig = field(default_factory=LocalGroundConfig)
    background: BackgroundConfig = field(default_factory=BackgroundConfig)


@dataclass(frozen=True)
class SingleObjectTrackerConfig:
    """Configuration of every tracker of one object; each tracker uses its own part.

    Attributes:
        box: The default tracker.
        point: Tracking loop of H-Fus, L-Fus, 3D-MS and 3D-KF.
        fusion: The thesis' fusion tracker H-Fus.
        baselines: L-Fus, 3D-MS, and the trackers in the image alone.
    """

    box: BoxFitTrackerConfig = field(default_factory=BoxFitTrackerConfig)
    point: CentroidTrackerConfig = field(default_factory=CentroidTrackerConfig)
    fusion: FusionTrackerConfig = field(default_factory=FusionTrackerConfig)
    baselines: BaselinesConfig = field(default_factory=BaselinesConfig)
