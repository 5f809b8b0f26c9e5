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
class BoxFitTrackerConfig:
    """The default tracker of one object: its box is fitted to the points, scan by scan.

    Attributes:
        initial_deviation_m: Standard deviation of the initial box along x and y.
        initial_deviation_rad: Standard deviation of the initial yaw.
        lost_after_s: Time without an observation after which the object is lost.
    """

    initial_deviation_m: float = 0.1
    initial_deviation_rad: float = 0.08
    lost_after_s: float = 3.0


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
