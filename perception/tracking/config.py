"""Configuration of the trackers of moving objects: boxes (the default), or points (the thesis' tracker)."""

import math
from dataclasses import dataclass, field
from typing import Literal

from perception.errors import UsageError
from perception.geometry.grids import MOVING_OBJECT_AREA, LocalArea


@dataclass(frozen=True)
class MotionModelConfig:
    """Constant-velocity motion over the ground, and the noise of box centres.

    Attributes:
        velocity_noise_m_s: Standard deviation of the change of velocity within a second, along x and along y.
        initial_speed_m_s: Standard deviation of the initial velocity of vehicles, along x and along y.
        small_initial_speed_m_s: Standard deviation of the initial velocity of pedestrians and cyclists.
        small_length_m: Maximum length and width of pedestrians and cyclists.
        side_noise_m: Standard deviation of the position of an observed side, from pose, range, and swinging arms.
        sampling: Share of the object's size, over the root of the number of points, by which an end may be missed.
        slack_share: Standard deviation of the centre as a share of the length that is not observed; 0.29 for a
            uniform distribution.
        max_swing_rad: Maximum standard deviation of the heading that shifts the centre of a partly hidden box.
        gate: Maximum squared Mahalanobis distance of a detection; 9.21 holds 99 % of true pairs (chi-squared,
            2 degrees of freedom).
        box_error_m: Standard deviation of a centre that no number of observations removes: a sparse side.
        velocity_inflation: Ratio of the reported variance of a velocity to that of the filter: most objects keep theirs,
            which the filter does not know.
    """

    velocity_noise_m_s: float = 0.9
    initial_speed_m_s: float = 6.0
    small_initial_speed_m_s: float = 3.0
    small_length_m: float = 1.3
    side_noise_m: float = 0.06
    sampling: float = 0.5
    slack_share: float = 0.3
    max_swing_rad: float = 0.3
    gate: float = 9.21
    box_error_m: float = 0.05
    velocity_inflation: float = 0.4


@dataclass(frozen=True)
class HeadingConfig:
    """Heading of a track, from its course and its shape.

    Attributes:
        turn_rate_rad_s: Standard deviation of the rate at which a heading turns; a car at a corner makes 0.5 rad/s.
        min_speed_m_s: Minimum speed at which the course is used.
        front_speed_m_s: Minimum speed at which the course distinguishes front and rear.
        max_deviation_rad: Maximum standard deviation of a course that is used.
        course_deviation_rad: Standard deviation of the heading from the course.
        shape_deviation_rad: Standard deviation of the heading from the axis of the outline's rectangle, of a car.
        car_length_m: Length of an outline from which on its axis is more certain, by the square of the length.
        shape_length_m: Minimum length of an outline whose axis is used.
        face_width_m: Range of widths of fronts and rears, from the smallest car to a van.
        unsettled_variance: Variance (rad²) above which a heading is replaced rather than corrected.
        reverse_speed_m_s: Maximum speed of a vehicle that drives backwards.
        vehicle_length_m: Minimum length of an object that may drive backwards.
    """

    turn_rate_rad_s: float = 0.4
    min_speed_m_s: float = 0.7
    front_speed_m_s: float = 0.3
    max_deviation_rad: float = 0.5
    course_deviation_rad: float = 0.06
    shape_deviation_rad: float = 0.2
    car_length_m: float = 5.2
    shape_length_m: float = 1.5
    face_width_m: tuple[float, float] = (1.3, 2.2)
    unsettled_variance: float = 0.3
    reverse_speed_m_s: float = 3.0
    vehicle_length_m: float = 2.4


@dataclass(frozen=True)
class SizeEstimateConfig:
    """Length, width and height of a track.

    Attributes:
        settling_hits: Number of hits before which the size is the observed one, as the heading is not known yet.
        min_complete_hits: Number of complete observations after which a length or width is known.
        complete_angle_rad: Minimum angle between line of sight and face at which the far end of the face is observed.
        vehicle_width_m: Minimum width of an object that has the length of a vehicle.
        vehicle_length_m: Minimum length of an object that has the width of a vehicle.
        length_per_width: Ratio of length to width of vehicles; 2.4 for the mean car, 2.7 for the mean van of KITTI.
        prior_length_m: Range of vehicle lengths, from a small car to a van.
        prior_width_m: Width of a vehicle of which only the side was observed.
        min_length_m: Minimum length of a moving object.
        min_width_m: Minimum width of a moving object.
        growth_gain: Gain of a correction to a larger size.
        shrink_gain: Gain of a correction to a smaller size.
        max_size_m: Maximum length and width, those of a city bus; larger clusters are several objects.
        height_gain: Gain of a correction of the height.
    """

    settling_hits: int = 4
    min_complete_hits: int = 5
    complete_angle_rad: float = math.radians(10.0)
    vehicle_width_m: float = 1.3
    vehicle_length_m: float = 2.4
    length_per_width: float = 2.4
    prior_length_m: tuple[float, float] = (3.6, 5.2)
    prior_width_m: float = 1.7
    min_length_m: float = 0.8
    min_width_m: float = 0.6
    growth_gain: float = 0.25
    shrink_gain: float = 0.03
    max_size_m: tuple[float, float] = (20.0, 3.2)
    height_gain: float = 0.3


@dataclass(frozen=True)
class TrackLifecycleConfig:
    """Confirmation, reporting and deletion of tracks.

    Attributes:
        min_hits: Number of moving observations before a well observed track is confirmed (M).
        min_hits_poorly_observed: Number of moving observations before a track of few points is confirmed.
        min_points_well_observed: Number of points, over all observations, of a well observed track.
        min_travel_m: Minimum distance from the first position before a track is confirmed, beyond the jitter of sides.
        min_speed_m_s: Minimum mean speed since the first observation before a track is confirmed; slower than
            the slowest pedestrian.
        max_unseen_unconfirmed_s: Time without an observation after which an unconfirmed track is deleted; at 10 Hz
            it may miss every second scan.
        max_unseen_s: Time without an observation after which a confirmed track is deleted; a car passes in front
            of a pedestrian within it.
        max_unseen_reported_s: Time without an observation for which a track of many hits is reported.
        min_hits_reported_unseen: Number of hits of a track that is reported without an observation.
        max_static_reported_s: Time for which a track that is continued by static clusters is reported.
        max_static_s: Time after which a track that is continued by static clusters is deleted.
        max_stopping_s: Time since the last observation within which a static cluster may continue a track.
        max_stopping_speed_m_s: Maximum speed of a track that a static cluster may continue.
    """

    min_hits: int = 2
    min_hits_poorly_observed: int = 5
    min_points_well_observed: int = 50
    min_travel_m: float = 0.15
    min_speed_m_s: float = 0.5
    max_unseen_unconfirmed_s: float = 0.25
    max_unseen_s: float = 1.2
    max_unseen_reported_s: float = 0.3
    min_hits_reported_unseen: int = 5
    max_static_reported_s: float = 1.0
    max_static_s: float = 3.0
    max_stopping_s: float = 0.35
    max_stopping_speed_m_s: float = 3.0


@dataclass(frozen=True)
class TrackUncertaintyConfig:
    """Standard deviations of reported boxes of moving objects.

    Attributes:
        length_m: Standard deviation of a length of which both ends are seen.
        hidden_share: Share of a class's standard deviations that observations leave of sizes that are not seen whole.
        axis_rad: Standard deviation of the axis of an outline.
        axis_share: Share of the filter's standard deviation of the heading that is reported beside it.
        reversal: Probability that the front is the rear.
    """

    length_m: float = 0.2
    hidden_share: float = 0.9
    axis_rad: float = 0.02
    axis_share: float = 0.6
    reversal: float = 0.01


@dataclass(frozen=True)
class BoxTrackerConfig:
    """Tracker of moving objects as boxes, the default.

    Attributes:
        motion: Motion model and gate.
        heading: Heading of a track.
        size: Size of a track.
        lifecycle: Confirmation, reporting and deletion of tracks.
        uncertainty: Standard deviations of reported boxes.
        fragment_margin_m: Margin around a track's predicted box within which clusters are fragments of one object.
        fragment_share: Maximum number of points of a fragment, as a share of those of the largest one.
        static_margin_m: Maximum excess of the size of a static cluster over that of the track it continues.
        static_min_share: Minimum size of a static cluster, as a share of the track's last observed size.
        static_reach_m: Distance from a static cluster of the previous scan within which a static cluster is not new.
    """

    motion: MotionModelConfig = field(default_factory=MotionModelConfig)
    heading: HeadingConfig = field(default_factory=HeadingConfig)
    size: SizeEstimateConfig = field(default_factory=SizeEstimateConfig)
    lifecycle: TrackLifecycleConfig = field(default_factory=TrackLifecycleConfig)
    uncertainty: TrackUncertaintyConfig = field(default_factory=TrackUncertaintyConfig)
    fragment_margin_m: float = 0.3
    fragment_share: float = 0.5
    static_margin_m: float = 0.5
    static_min_share: float = 0.6
    static_reach_m: float = 0.3


@dataclass(frozen=True)
class PointTrackerConfig:
    """The thesis' tracker of moving objects as points (5.2.2, Tracking Module).

    The thesis gives no noise and no gate; those values are the released program's.

    Attributes:
        step_s: Time step of the filters; None takes it from the stamps. The released program assumes 0.1 s.
        process_variance: Factor of the identity matrix Q, added every 0.1 s, in m² and (m/s)².
        measurement_variance_m2: Factor of the identity matrix R.
        initial_variance: Factor of the identity matrix P0, in m² and (m/s)²; the initial speed is 0.
        gate_m: Maximum distance of a detection from its track.
        gate_around: Centre of the gate: the predicted position, as the thesis implies, or the last estimate
            (released program).
        on_miss: Estimate of a track without a detection: its prediction (thesis), or a correction by the last
            position, which brakes the track to a halt (released program).
        confirms: Whether a new track is deleted where the next frame does not detect it (thesis).
        area: Local grid in the LiDAR frame, outside of which no track is reported (5.2.2: 10 m behind, 30 m
            ahead, 10 m to each side).
        kept_beyond_area_m: Distance outside the local grid at which a track is deleted.
    """

    step_s: float | None = None
    process_variance: float = 5.0
    measurement_variance_m2: float = 0.5
    initial_variance: float = 5.0
    gate_m: float = 4.0
    gate_around: Literal["prediction", "last estimate"] = "prediction"
    on_miss: Literal["predict", "hold"] = "predict"
    confirms: bool = True
    area: LocalArea = MOVING_OBJECT_AREA
    kept_beyond_area_m: float = 0.0

    def __post_init__(self) -> None:
        """Validate that time step, variances and gate are positive."""
        positive = (self.process_variance, self.measurement_variance_m2, self.initial_variance)
        if min(*positive, self.gate_m, 1.0 if self.step_s is None else self.step_s) <= 0:
            raise UsageError(
                "point tracker", expected="a step, variances and a gate above 0", found=str(self)
            )


THESIS_POINT_TRACKER = PointTrackerConfig()
# The released program deletes no track, so that its cost grows with the drive. A detection lies in the
# local grid, and nothing beyond the gate around it can matter unless the vehicle comes back; 40 m, the
# length of the grid, lets it turn round and still find its tracks.
AUTHOR_POINT_TRACKER = PointTrackerConfig(
    step_s=0.1,
    gate_around="last estimate",
    on_miss="hold",
    confirms=False,
    kept_beyond_area_m=40.0,
)
