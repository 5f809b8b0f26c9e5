"""Configuration of the tracker of detected vehicles."""

from dataclasses import dataclass, field

from perception.tracking.config import MotionModelConfig


@dataclass(frozen=True)
class SharedIdsConfig:
    """When a detected vehicle and a track of a moving object are one object, with one id.

    Attributes:
        min_iou: Minimum IoU on the ground of the vehicle and the track.
        scans: Number of consecutive scans together before two ids become one, and apart before one becomes two.
    """

    min_iou: float = 0.15
    scans: int = 3


@dataclass(frozen=True)
class DuplicateConfig:
    """When a detection is a second box of an object that a better detection has found.

    Attributes:
        min_iou: Minimum IoU in the image, unless the returns of both lie apart.
        min_iou_apart: Minimum IoU in the image where the returns of both lie apart.
        min_iou_cameras: Minimum IoU from above of two boxes of different cameras, of which only one is tracked.
        min_share: Minimum share of a box without returns that lies within the other.
        same_place_iou: Minimum IoU in the image of detections of several classes that are one object.
    """

    min_iou: float = 0.4
    min_iou_apart: float = 0.75
    min_iou_cameras: float = 0.1
    min_share: float = 0.7
    same_place_iou: float = 0.6


@dataclass(frozen=True)
class EvidenceConfig:
    """Evidence that a track is an object: log-odds, summed over frames.

    Attributes:
        prior: Existence of a detection that is no evidence either way.
        miss: Evidence that a frame without a detection takes away.
        confirmation: Minimum evidence of a confirmed track; one detection is never enough.
        memory: Share of the past evidence that the next frame leaves, since detections of one object err alike.
        height_deviation_m: Standard deviation of the height of a track, which tells classes apart.
        class_score_weight: Weight of the logarithm of scores beside that of the likelihood of a height.
        min_height_deviation_m: Minimum standard deviation of the height of a class, against which the height that the
            image shows is evidence.
        top_deviation_px: Standard deviation of the upper side of the 2D box.
        top_deviation_share: Increase of the same, as a share of the box's height.
        max_height_evidence: Maximum evidence that a height takes away.
    """

    prior: float = 0.5
    miss: float = 0.1
    confirmation: float = 1.5
    memory: float = 0.85
    height_deviation_m: float = 0.03
    class_score_weight: float = 0.2
    min_height_deviation_m: float = 0.15
    top_deviation_px: float = 1.0
    top_deviation_share: float = 0.05
    max_height_evidence: float = 3.0


@dataclass(frozen=True)
class BoxUncertaintyConfig:
    """Standard deviations of reported boxes; a hidden end is as uncertain as the size of the class, which may be another.

    Attributes:
        side_noise_m: Standard deviation of an observed side, at any distance.
        side_noise_per_m: Increase of that standard deviation with distance.
        sparse_noise_m: Standard deviation of a side located by one point; divided by the root of the number of points.
        size_noise_per_m: Standard deviation of length and width, divided by the distance.
        hidden_share: Share of a class's standard deviation of length and width that is left of an object that is tracked.
        single_scan_mistakes: Ratio of the probability of another class in a single scan to that of a tracked object.
        height_noise_m: Standard deviation of the height, at any distance.
        height_share: Share of the standard deviation of its class that is left of the height of an object with sides.
        person_height_share: The same of a person.
        height_range_m: Distance from which on returns tell a height no better than the class; the variance grows with its
            fourth power.
        axis_noise_rad: Standard deviation of the axis of an outline of many points.
        sparse_axis_noise_rad: Standard deviation of the axis of an outline of one point; divided by the same root.
        track_share: Share of the variance of the tracker's position that is reported beside that of the hidden ends: its
            noise holds these, too.
        velocity_share: The same of the velocity: most vehicles keep theirs.
        traffic_reversal: Probability that a vehicle faces against the traffic there, of which front and rear are taken until
            it moves.
        course_reversal: The same once it has moved.
        person_reversal: The same of people, whose outline hardly shows a heading.
    """

    side_noise_m: float = 0.06
    side_noise_per_m: float = 0.005
    sparse_noise_m: float = 0.4
    size_noise_per_m: float = 0.002
    hidden_share: float = 0.7
    single_scan_mistakes: float = 4.0
    height_noise_m: float = 0.03
    height_share: float = 0.3
    person_height_share: float = 0.75
    height_range_m: float = 50.0
    axis_noise_rad: float = 0.03
    sparse_axis_noise_rad: float = 0.3
    track_share: float = 0.25
    velocity_share: float = 0.5
    traffic_reversal: float = 0.1
    course_reversal: float = 0.02
    person_reversal: float = 0.4


@dataclass(frozen=True)
class VehicleTrackerConfig:
    """Tracker of detected vehicles, in the image and on the ground.

    Attributes:
        min_existence: Minimum existence of a detection that is located in the scan and may continue a track.
        new_track_existence: Minimum existence of a detection that may begin a track.
        high_existence: Minimum existence of a detection that is assigned before the others.
        evidence: Evidence that a track exists.
        duplicates: Second detections of one object.
        max_unseen_unconfirmed_s: Time without a detection after which an unconfirmed track is deleted.
        max_unseen_s: Time without a detection after which a confirmed track is deleted.
        min_iou: Minimum IoU in the image of a detection and the track that it continues.
        side_deviation_share: Standard deviation of the sides of a 2D box from their prediction, as a share of its
            width and height.
        min_size_px: Minimum width and height in that share.
        max_walking_speed_m_s: Speed from which on a person rides; detectors see the rider of a cycle, too.
        max_riding_votes: Number of detections above that speed, less those below, that settle that a person rides.
        class_change_cost: Cost of a detection of another class than that of the track.
        max_cost: Maximum squared distance of a detection, four sides and a position, in standard deviations; 30
            leaves out 1 of 20,000 true pairs (chi-squared, 6 degrees of freedom).
        position_noise_m: Standard deviation of a located position, at any distance.
        position_noise_per_m: Increase of that standard deviation with distance.
        sparse_noise_m: Standard deviation of a position located by one point; divided by the root of the number
            of points.
        assumed_height_m: Height of an object without returns, which places it by its height in the image.
        assumed_depth_share: Standard deviation of its depth, as a share of the depth.
        assumed_side_share: Standard deviation of its position across the line of sight, as a share of its width.
        box_gain: Gain of the correction of a box in the image.
        outline_weight: Weight of the outline of a 3D box in the reported box of a vehicle in the image.
        min_hiding_height: Minimum share of the height of a box at which a nearer one hides its left or right side.
        max_hiding_gap: Maximum gap between that side and the nearer box, as a share of the width.
        min_hiding_depth_m: Minimum difference of the depths of their middles.
        max_outline_share: Maximum difference of their sides, as a share of width and height, of boxes that agree.
        relocate_after_s: Time located elsewhere than predicted after which a track moves there.
        max_unlocated_s: Time without returns after which a track has the place and the class of its image alone.
        heading_memory: Share of the past observations of the heading that the next one leaves.
        course_speed_m_s: Minimum speed at which the course corrects the heading.
        front_speed_m_s: Minimum speed at which the course distinguishes front and rear.
        min_travelled_m: Minimum distance after which the course alone distinguishes them, and the traffic around no more.
        small_length_m: Maximum length of people on foot and on two wheels, whose outline hardly shows a heading.
        small_course_speed_m_s: Both minimum speeds of these.
        small_course_weight: Number of observations of the outline that their course outweighs.
        max_front_votes: Maximum number of observations of the course that opposite ones have to outweigh before
            front and rear change places.
        max_size_samples: Maximum number of observations that a size is averaged over.
        max_reported_speed_deviation_m_s: Maximum standard deviation of a reported velocity.
        motion: Motion model on the ground and its gate.
        box: Standard deviations of reported boxes.
        shared_ids: Common ids with the tracks of moving objects.
    """

    min_existence: float = 0.2
    new_track_existence: float = 0.5
    high_existence: float = 0.5
    evidence: EvidenceConfig = field(default_factory=EvidenceConfig)
    duplicates: DuplicateConfig = field(default_factory=DuplicateConfig)
    max_unseen_unconfirmed_s: float = 0.25
    max_unseen_s: float = 1.5
    min_iou: float = 0.1
    side_deviation_share: float = 0.16
    min_size_px: float = 4.0
    max_walking_speed_m_s: float = 3.0
    max_riding_votes: int = 10
    class_change_cost: float = 10.0
    max_cost: float = 30.0
    position_noise_m: float = 0.2
    position_noise_per_m: float = 0.01
    sparse_noise_m: float = 1.2
    assumed_height_m: float = 1.6
    assumed_depth_share: float = 0.3
    assumed_side_share: float = 0.12
    box_gain: float = 0.5
    outline_weight: float = 0.6
    min_hiding_height: float = 0.5
    max_hiding_gap: float = 0.15
    min_hiding_depth_m: float = 1.0
    max_outline_share: float = 0.4
    relocate_after_s: float = 0.35
    max_unlocated_s: float = 2.0
    heading_memory: float = 0.7
    course_speed_m_s: float = 2.0
    front_speed_m_s: float = 1.0
    min_travelled_m: float = 2.0
    small_length_m: float = 2.2
    small_course_speed_m_s: float = 0.6
    small_course_weight: float = 5.0
    max_front_votes: int = 10
    max_size_samples: int = 12
    max_reported_speed_deviation_m_s: float = 2.0
    motion: MotionModelConfig = field(default_factory=MotionModelConfig)
    box: BoxUncertaintyConfig = field(default_factory=BoxUncertaintyConfig)
    shared_ids: SharedIdsConfig = field(default_factory=SharedIdsConfig)
