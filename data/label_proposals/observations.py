"""What the pipeline found in the frames of a drive, in the world."""

from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray

from perception.detection.bev.classes import GROUPS
from perception.geometry.boxes import transform_boxes
from perception.types import ArrayTable, Boxes3D, Float64, Int, Result

OTHER_GROUP = -1


@dataclass(frozen=True)
class Observations(ArrayTable):
    """R detected boxes of a drive, frame by frame.

    Attributes:
        frames: (R,) frame indices.
        stamps_s: (R,) times.
        boxes_world: (R) boxes in the world frame.
        types: (R,) classes.
        groups: (R,) group of the class: within one, classes are mistaken for each other.
        scores: (R,) scores, 0 to 1.
        velocities_m_s: (R, 2) velocities over the ground along x and y of the world; NaN where not known.
        points: (R,) number of returns.
        sensors_world: (R, 2) place of the LiDAR.
    """

    frames: Int
    stamps_s: Float64
    boxes_world: Boxes3D
    types: NDArray[np.str_]
    groups: Int
    scores: Float64
    velocities_m_s: Annotated[Float64, 2]
    points: Int
    sensors_world: Annotated[Float64, 2]

    @classmethod
    def of_result(cls, result: Result, min_score: float) -> Self:
        """Return the vehicles of a frame that have a 3D box and a score from a limit on.

        Args:
            result: Result of the frame.
            min_score: Limit of the score.
        """
        if (vehicles := result.vehicles) is None:
            return cls.empty()
        detections, pose = vehicles.fused.detections, result.world_SE3_velo
        is_used = np.isfinite(vehicles.boxes.yaw_rad) & (detections.scores >= min_score)
        rows = np.flatnonzero(is_used)
        types, count = detections.types[rows], len(rows)
        return cls(
            frames=np.full(count, result.frame.index),
            stamps_s=np.full(count, result.frame.stamp_s),
            boxes_world=transform_boxes(pose, vehicles.boxes[rows]),
            types=types,
            groups=np.array([GROUPS.get(one, OTHER_GROUP) for one in types.tolist()], np.int64),
            scores=detections.scores[rows].astype(np.float64),
            velocities_m_s=vehicles.velocities_m_s[rows] @ pose[:2, :2].T,
            points=vehicles.point_counts[rows],
            sensors_world=np.tile(pose[:2, 3], (count, 1)),
        )
