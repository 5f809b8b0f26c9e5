"""Protocols of the evaluations: which objects count, what matches them, and at which thresholds."""

from dataclasses import dataclass, field
from typing import Literal

from perception.errors import UsageError
from perception.geometry.grids import MOVING_OBJECT_AREA, LocalArea

EvaluationView = Literal["camera", "all"]

# Thresholds at which a frame of one tracked object counts as correct.
MIN_OVERLAP = 0.25  # 3D overlap (IoU) that must be exceeded (A.1)
MAX_HEADING_DEG = 10.0  # heading error that must not be reached (A.2)
MAX_LOCATION_PX = 20.0  # centre error in the image that must not be reached (A.3)
MAX_CENTER_M = 2.0  # centre error up to which precision is measured


@dataclass(frozen=True)
class MotionLabelConfig:
    """Thresholds at which a labelled object counts as moving.

    Boxes of parked cars travel at up to 0.56 m/s in KITTI's sequence 0000, as annotation and INS drift;
    the slowest pedestrians of sequences 0000, 0016 and 0017 walk at 1.04 m/s. The pair of thresholds lies
    between the two.

    Attributes:
        start_m_s: Speed in m/s from which on an object moves.
        stop_m_s: Speed in m/s below which a moving object becomes static.
        window_s: Time in s over which a speed is measured: ten scans, so that the jitter of boxes averages out.
        min_duration_s: Time in s that a track must span for its object to count as static.
        min_travel_m: Distance in m that a moving object must travel within the window.
    """

    start_m_s: float = 0.8
    stop_m_s: float = 0.6
    window_s: float = 1.0
    min_duration_s: float = 0.5
    min_travel_m: float = 0.5

    def __post_init__(self) -> None:
        """Validate the order of the thresholds."""
        if not (0 < self.stop_m_s <= self.start_m_s and 0 < self.min_duration_s <= self.window_s):
            raise UsageError(
                "motion thresholds",
                expected="0 < stop_m_s <= start_m_s and 0 < min_duration_s <= window_s",
                found=str(self),
            )


@dataclass(frozen=True)
class ObjectMatchConfig:
    """Thresholds at which a labelled object counts, is found as an obstacle, and is found to move.

    Attributes:
        min_points: Number of scan points that the box of an object must hold.
        clearance_m: Height in m over the box's bottom below which points count as ground; the thesis' d_min.
        found_share: Share of the object's points that must be classified as obstacle, 0 to 1.
        moving_share: Share of the object's obstacle points that must be classified as moving, 0 to 1.
    """

    min_points: int = 20
    clearance_m: float = 0.2
    found_share: float = 0.5
    moving_share: float = 0.25

    def __post_init__(self) -> None:
        """Validate the shares and the number of points."""
        shares = (self.found_share, self.moving_share)
        if self.min_points < 1 or not all(0 <= share <= 1 for share in shares):
            raise UsageError(
                "labelled objects",
                expected="min_points of at least 1 and shares from 0 to 1",
                found=str(self),
            )


@dataclass(frozen=True)
class ObstacleProtocol:
    """Protocol of the obstacle evaluation.

    Attributes:
        objects: Labelled objects.
        motion: Motion of labelled objects.
    """

    objects: ObjectMatchConfig = field(default_factory=ObjectMatchConfig)
    motion: MotionLabelConfig = field(default_factory=MotionLabelConfig)


@dataclass(frozen=True)
class MovingObjectConfig:
    """Moving objects that must be tracked, and the similarity at which a track matches one.

    Attributes:
        area: Area in the LiDAR frame outside of which nothing is evaluated.
        min_points: Number of scan points that the box of an object must hold.
        clearance_m: Height in m over the box's bottom below which points count as ground.
        max_distance_m: Distance in m between centres at which the similarity falls to 0.
        min_similarity: Similarity from which on a track may match an object: 0.25 is a distance of three
            quarters of `max_distance_m`, or an overlap (IoU) of 0.25.
    """

    area: LocalArea = MOVING_OBJECT_AREA
    min_points: int = 20
    clearance_m: float = 0.2
    max_distance_m: float = 2.0
    min_similarity: float = 0.25

    def __post_init__(self) -> None:
        """Validate the number of points, the distance and the similarity."""
        if self.min_points < 1 or self.max_distance_m <= 0 or not 0 < self.min_similarity <= 1:
            raise UsageError(
                "moving objects",
                expected="min_points of at least 1, max_distance_m over 0, min_similarity over 0 and up to 1",
                found=f"{self.min_points}, {self.max_distance_m:g}, {self.min_similarity:g}",
            )


@dataclass(frozen=True)
class DatmoProtocol:
    """Protocol of the evaluation of tracked moving objects.

    Attributes:
        targets: Objects that must be tracked.
        motion: Motion of labelled objects.
        view: Evaluate the camera's view, or everything around, which takes exact truth.
        distance_threshold: Similarity by distance at which CLEAR and identity match; 0.5 is half of
            `targets.max_distance_m`.
        overlap_threshold: Overlap (IoU) at which CLEAR and identity match.
        loose_overlap_threshold: Second overlap, for boxes that hold only the visible part of an object.
    """

    targets: MovingObjectConfig = field(default_factory=MovingObjectConfig)
    motion: MotionLabelConfig = field(default_factory=MotionLabelConfig)
    view: EvaluationView = "camera"
    distance_threshold: float = 0.5
    overlap_threshold: float = 0.5
    loose_overlap_threshold: float = 0.3
