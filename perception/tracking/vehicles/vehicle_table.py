"""What is remembered of detected vehicles, and every choice that the tracker of them makes."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.tracking.columns import GroundPlaneTracks
from perception.types import Bool, Float64, Int


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
