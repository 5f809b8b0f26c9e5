"""Table of the tracks of detected vehicles."""

from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray

from perception.tracking.tracker import GroundPlaneTracks
from perception.types import Bool, Detections, Float64, Int


@dataclass(frozen=True)
class VehicleTable(GroundPlaneTracks):
    """T tracked vehicles.

    Attributes:
        ids: (T,) ids; -1 of unconfirmed tracks.
        types: (T,) class of the detections.
        scores: (T,) score of the last detection.
        score_sum: (T,) sum of the scores of the detections.
        last_seen_s: (T,) time of the last detection.
        boxes_px: (T, 4) box in the image at the last detection.
        speeds_px_s: (T, 4) velocities of its sides.
        anchors_px: (T, 3) column, row and depth in metres of the middle of the 3D box at the last detection.
        is_located: (T,) whether it was ever located on the ground; otherwise the columns below, mean and covariance
            are void.
        last_located_s: (T,) time of the last detection that was located.
        axis: (T, 2) sum of the observed headings, as cosine and sine of twice the angle.
        front_votes: (T,) observations of the course that agree with the heading, less those against it.
        sizes_m: (T, 3) mean length, width and height.
        size_samples: (T,) number of observations of the mean.
    """

    ids: Int
    types: NDArray[np.str_]
    scores: Float64
    score_sum: Float64
    last_seen_s: Float64
    boxes_px: Annotated[Float64, 4]
    speeds_px_s: Annotated[Float64, 4]
    anchors_px: Annotated[Float64, 3]
    is_located: Bool
    last_located_s: Float64
    axis: Annotated[Float64, 2]
    front_votes: Int
    sizes_m: Annotated[Float64, 3]
    size_samples: Int

    @property
    def speed_deviations_m_s(self) -> Float64:
        """(T,) larger standard deviation of the velocity along x or y."""
        variances = np.diagonal(self.covariance, axis1=1, axis2=2)[:, 2:]
        return np.asarray(np.sqrt(variances.max(axis=1, initial=0.0)))

    @classmethod
    def init_in_image(cls, detections: Detections, stamp_s: float) -> Self:
        """Return the tracks of T vehicles after one detection in the image alone."""
        count = len(detections)
        return cls(
            ids=np.full(count, -1),
            types=detections.types,
            scores=detections.scores,
            score_sum=detections.scores,
            last_seen_s=np.full(count, stamp_s),
            boxes_px=detections.boxes_px,
            speeds_px_s=np.zeros((count, 4)),
            anchors_px=np.zeros((count, 3)),
            is_located=np.zeros(count, bool),
            last_located_s=np.full(count, stamp_s),
            mean=np.zeros((count, 4)),
            covariance=np.zeros((count, 4, 4)),
            axis=np.zeros((count, 2)),
            front_votes=np.zeros(count, np.int64),
            yaw_rad=np.zeros(count),
            sizes_m=np.zeros((count, 3)),
            size_samples=np.zeros(count, np.int64),
            low_world_m=np.zeros(count),
        )
