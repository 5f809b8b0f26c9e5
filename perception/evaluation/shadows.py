"""Shadows: false static obstacles that moving objects leave behind in the static model (Table 7.2).

A place that a moving object occupied a moment ago cannot hold a static obstacle. Static voxels in it are the
object's shadow: the thesis' main kind of false obstacle with slow objects, and the only kind that KITTI's
labels can prove.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from perception.evaluation.config import ClusterConfig, ShadowConfig
from perception.evaluation.false_clusters import cluster_ids
from perception.evaluation.objects import FrameAnnotations, MotionState
from perception.geometry.boxes import points_inside, transform_boxes
from perception.geometry.camera import is_in_view
from perception.geometry.se3 import inverse
from perception.types import ArrayTable, Bool, Boxes3D, Float32, Int, Result


@dataclass(frozen=True)
class Shadows(ArrayTable):
    """Shadows in F frames.

    Attributes:
        frames: (F,) Number of the frame.
        voxels: (F,) Number of static voxels in places that moving objects have left.
        clusters: (F,) Number of clusters of these voxels.
    """

    frames: Int
    voxels: Int
    clusters: Int


class ShadowDetector:
    """Remembers for a while where labelled objects have moved, in the world frame."""

    def __init__(self, config: ShadowConfig | None = None) -> None:
        self._config = config or ShadowConfig()
        self._past: deque[tuple[float, Boxes3D]] = deque()

    def update(self, result: Result, annotations: FrameAnnotations) -> Shadows:
        """Find the shadows among the static voxels of one frame, then remember its moving objects."""
        static_velo, stamp_s = result.obstacles.static.centers_m, result.frame.stamp_s
        world_SE3_velo = result.world_SE3_velo
        while self._past and self._past[0][0] < stamp_s - self._config.memory_s:
            self._past.popleft()
        lies_in_shadow = np.zeros(len(static_velo), bool)
        for _, boxes_world in self._past:
            boxes_velo = transform_boxes(inverse(world_SE3_velo), boxes_world)
            lies_in_shadow |= _is_within(boxes_velo, static_velo, self._config)
        present = annotations.objects.boxes_velo
        lies_in_shadow &= ~points_inside(present, static_velo, self._config.margin_m).any(axis=0)
        lies_in_shadow &= is_in_view(
            annotations.view.calibration, static_velo, annotations.view.image_size_px
        )
        moving = present[annotations.objects.motions == MotionState.MOVING]
        self._past.append((stamp_s, transform_boxes(world_SE3_velo, moving)))
        sizes = np.bincount(cluster_ids(static_velo[lies_in_shadow], ClusterConfig()))
        return Shadows(
            frames=np.array([result.frame.index]),
            voxels=np.array([np.count_nonzero(lies_in_shadow)]),
            clusters=np.array([np.count_nonzero(sizes >= self._config.min_voxels)]),
        )


def _is_within(boxes: Boxes3D, points: Float32, config: ShadowConfig) -> Bool:
    lift_m = np.array([0.0, 0.0, config.clearance_m])
    raised = Boxes3D(
        boxes.bottom_m + lift_m,
        boxes.size_m - lift_m,
        boxes.yaw_rad,
    )
    return np.asarray(points_inside(raised, points, -config.shrink_m).any(axis=0))
