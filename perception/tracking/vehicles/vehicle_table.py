"""What is remembered of detected vehicles, and every choice that the tracker of them makes."""

from dataclasses import dataclass, field
from typing import Self

import numpy as np

from perception.tracking.columns import GroundPlaneTracks
from perception.tracking.motion_model import MotionModelConfig
from perception.types import Bool, Float64, Int


@dataclass(frozen=True)
class VehicleTrackerConfig:
    """Every choice of the tracker of vehicles.

    Attributes:
        motion: how vehicles move over the ground.
        min_score: of a detection that may continue a track.
        new_track_score: of one that may begin a track.
        high_score: of one that chooses its track before the others.
        min_score_sum: sum of scores from which on a track is believed; one sight is never enough.
        max_unseen_unconfirmed_s: how long a track lives unseen before it is believed.
        max_unseen_s: how long afterwards.
        min_iou: in the image, of a detection and the track that it continues.
        side_deviation_share: standard deviation of the sides of a box in the image from where they are expected, as a
            share of its width and height.
        min_size_px: of boxes that are smaller, sides are no better known than of such.
        most_apart: squared distance of four sides and a place on the ground, in standard deviations, from
            which on a detection continues no track; of true pairs 1 in 20,000 is farther (chi-squared, 6
            degrees).
        position_noise_m: standard deviation of the place of a box, whatever its distance.
        position_noise_per_m: by which it grows with distance.
        sparse_noise_m: of the place of a box around one point; over the root of how many there are.
        relocate_after_s: how long a track may be seen elsewhere than expected before it is believed to be there.
        heading_memory: share of what is known of a heading that is left after the next sight.
        course_speed_m_s: faster, the velocity tells the heading, too.
        sign_speed_m_s: faster, it tells front from rear.
        max_size_samples: over so many, sizes are averaged.
        max_reported_speed_deviation_m_s: standard deviation of a velocity that is told.
        image_speed_gain: share of the way to a new motion in the image of what is nowhere on the ground.
    """

    motion: MotionModelConfig = field(default_factory=MotionModelConfig)
    min_score: float = 0.1
    new_track_score: float = 0.3
    high_score: float = 0.5
    min_score_sum: float = 1.2
    max_unseen_unconfirmed_s: float = 0.25
    max_unseen_s: float = 1.5
    min_iou: float = 0.1
    side_deviation_share: float = 0.12
    min_size_px: float = 4.0
    most_apart: float = 30.0
    position_noise_m: float = 0.2
    position_noise_per_m: float = 0.01
    sparse_noise_m: float = 1.2
    relocate_after_s: float = 0.35
    heading_memory: float = 0.7
    course_speed_m_s: float = 2.0
    sign_speed_m_s: float = 1.0
    max_size_samples: int = 12
    max_reported_speed_deviation_m_s: float = 2.0
    image_speed_gain: float = 0.5


@dataclass(frozen=True)
class VehicleTable(GroundPlaneTracks):
    """T followed vehicles.

    Attributes:
        ids: (T,) -1 before they are believed.
        score_sum: (T,) sum of their scores.
        last_seen_s: (T,) stamp of the last sight.
        boxes_px: (T, 4) in the image at the last sight.
        speeds_px_s: (T, 4) of its sides.
        anchors_px: (T, 3) column, row and depth in metres of the middle of the 3D box at the last sight.
        is_located: (T,) whether it was ever found on the ground; else what follows, mean and covariance are void.
        last_located_s: (T,) stamp of the last sight there.
        axis: (T, 2) sum of sights of the heading, as cosine and sine of twice the angle.
        yaw_rad: (T,) heading in the world.
        sizes_m: (T, 3) length, width, height: means so far.
        size_samples: (T,) over how many sights.
        low_world_m: (T,) z of the ground below.
    """

    ids: Int
    score_sum: Float64
    last_seen_s: Float64
    boxes_px: Float64
    speeds_px_s: Float64
    anchors_px: Float64
    is_located: Bool
    last_located_s: Float64
    axis: Float64
    yaw_rad: Float64
    sizes_m: Float64
    size_samples: Int
    low_world_m: Float64

    @property
    def speed_deviations_m_s(self) -> Float64:
        """(T,) standard deviation of the velocity along x or y, the greater."""
        variances = np.diagonal(self.covariance, axis1=1, axis2=2)[:, 2:]
        return np.asarray(np.sqrt(variances.max(axis=1, initial=0.0)))

    @classmethod
    def init_in_image(cls, boxes_px: Float64, scores: Float64, stamp_s: float) -> Self:
        """Return what is known of T vehicles after one sight in the image alone."""
        count = len(boxes_px)
        return cls(
            ids=np.full(count, -1),
            score_sum=scores,
            last_seen_s=np.full(count, stamp_s),
            boxes_px=boxes_px,
            speeds_px_s=np.zeros((count, 4)),
            anchors_px=np.zeros((count, 3)),
            is_located=np.zeros(count, bool),
            last_located_s=np.full(count, stamp_s),
            mean=np.zeros((count, 4)),
            covariance=np.zeros((count, 4, 4)),
            axis=np.zeros((count, 2)),
            yaw_rad=np.zeros(count),
            sizes_m=np.zeros((count, 3)),
            size_samples=np.zeros(count, np.int64),
            low_world_m=np.zeros(count),
        )
