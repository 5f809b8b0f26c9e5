"""Moving object segmentation (MOS): IoU of moving points, moving objects missed, and false moving clusters.

- Truth is that of points where there is one: exact, or classes as of SemanticKITTI-MOS. Else points in the boxes of moving
  objects move; those within 0.5 m of such a box, or of one whose motion is unknown, do not count, nor do those where
  nothing is labelled: in DontCare regions, and beside the camera's view unless everything around is labelled.
- Points of the local area count, below its height, wherever they lie around the vehicle.
- A moving object counts once a scan where enough of its points do; it is missed where less than the required share of them
  is MOVING.
- A cluster of 20 MOVING points and more is false where at least half of them do not move.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from perception.evaluation.config import ObjectMatchConfig
from perception.evaluation.confusion import Confusion, confusion
from perception.evaluation.exact_obstacles import count_false
from perception.evaluation.ground import UNLABELLED_CLASSES
from perception.evaluation.objects import LabelledObjects, LabelledView, MotionState
from perception.evaluation.report import Metric, SummedMetrics
from perception.geometry.boxes import points_inside
from perception.types import Float, Float64, Int, PointState, PointTruth, Result

_FALSE_POINTS = 20  # of the smallest false cluster
_MARGIN_M = 0.5  # around boxes, as loose as labels are
_OBJECT_CLASS, _UNLABELLED_CLASS = 99, 0
_SPEEDS_M_S = {
    "under 2 m/s": (0.0, 2.0),
    "2 to 5 m/s": (2.0, 5.0),
    "5 to 10 m/s": (5.0, 10.0),
    "over 10 m/s": (10.0, np.inf),
}


@dataclass(frozen=True)
class MotionCounts(SummedMetrics):
    """Moving points and objects of any number of scans.

    Attributes:
        scans: Number of scans.
        points: Confusion of moving points.
        objects: Number of moving objects, each counted once a scan.
        missed: Number of these that are not found to move.
        false_clusters: Number of false moving clusters of 20 points and more.
    """

    scans: int = 0
    points: Confusion = field(default_factory=Confusion)
    objects: Annotated[int, Metric("moving objects")] = 0
    missed: Annotated[int, Metric("found static")] = 0
    false_clusters: Annotated[int, Metric("false clusters")] = 0

    @property
    def missed_share(self) -> Annotated[float, Metric("found static [%]", ".1%")]:
        """Share of the moving objects that are not found to move; NaN without any."""
        return self.missed / self.objects if self.objects else float("nan")

    @property
    def recall(self) -> Annotated[float, Metric("recall", ".3f")]:
        """Share of the moving points that are found."""
        return self.points.recall

    @property
    def precision(self) -> Annotated[float, Metric("precision", ".3f")]:
        """Share of the points found to move that do."""
        return self.points.precision

    @property
    def iou(self) -> Annotated[float, Metric("IoU", ".3f")]:
        """IoU of the moving points."""
        return self.points.iou

    @property
    def false_a_scan(self) -> Annotated[float, Metric("false clusters/scan", ".3f")]:
        """Number of false moving clusters a scan; NaN without a scan."""
        return self.false_clusters / self.scans if self.scans else float("nan")


def count_motion(
    result: Result,
    truth: PointTruth,
    config: ObjectMatchConfig,
    speeds_m_s: Mapping[int, float],
) -> dict[str, MotionCounts]:
    """Count the moving points and objects of a scan: of all of it, and of the objects of each class of speeds.

    Args:
        result: Scan with its states.
        truth: Truth of its points; those without a class do not count.
        config: Thresholds at which an object counts and is found to move.
        speeds_m_s: Speeds of objects by their instance, as far as they are known.
    """
    states = result.obstacles.point_states
    counts = (states != PointState.OUTSIDE) & ~np.isin(truth.classes, UNLABELLED_CLASSES)
    found, moves = states[counts] == PointState.MOVING, truth.is_moving[counts]
    instances = np.where(moves, truth.instances[counts], 0)
    points = np.bincount(instances, minlength=1)
    moving = np.bincount(instances, found, minlength=1)
    is_object = points >= config.min_points
    is_object[0] = False
    is_missed = is_object & ((moving == 0) | (moving < config.moving_share * points))
    speeds = np.array([speeds_m_s.get(number, np.nan) for number in range(len(points))])
    false = count_false(
        result.frame.points_velo[counts][found], moves[found], min_points=_FALSE_POINTS
    )
    everything = MotionCounts(
        1, confusion(found, moves), int(is_object.sum()), int(is_missed.sum()), false
    )
    by_speed = {}
    for name, (low, high) in _SPEEDS_M_S.items():
        of_class = (speeds >= low) & (speeds < high)
        members = of_class[instances] & moves
        by_speed[name] = MotionCounts(
            points=confusion(found[members], moves[members]),
            objects=int(np.count_nonzero(is_object & of_class)),
            missed=int(np.count_nonzero(is_missed & of_class)),
        )
    return {"all": everything, **by_speed}


def truth_of_boxes(
    points_velo: Float, objects: LabelledObjects, view: LabelledView | None, clearance_m: float
) -> PointTruth:
    """Return which points move, by labelled boxes; points that boxes do not decide have no class.

    Args:
        points_velo: (N, 3+) points of the scan.
        objects: Labelled objects and their motion.
        view: Image outside of which nothing is labelled; None where everything around is.
        clearance_m: Height over the bottom of a box below which points may be ground.
    """
    boxes, motions = objects.boxes_velo, objects.motions
    inside = points_inside(boxes, points_velo)
    is_high = points_velo[:, 2] >= boxes.bottom_m[:, 2, None] + clearance_m
    instances = np.zeros(len(points_velo), np.int64)
    is_moving = np.zeros(len(points_velo), bool)
    is_open = np.zeros(len(points_velo), bool)
    for row in np.flatnonzero(motions != MotionState.STATIC):
        is_open |= points_inside(boxes[row : row + 1], points_velo, _MARGIN_M)[0]
    for row in np.flatnonzero(motions != MotionState.UNKNOWN):
        members = inside[row] & is_high[row]
        instances[members] = objects.track_ids[row] + 1
        is_moving[members] = motions[row] == MotionState.MOVING
        is_open &= ~members
    if view is not None:
        is_open |= ~view.contains(points_velo) | view.is_dont_care(points_velo)
    classes = np.where(is_open, _UNLABELLED_CLASS, _OBJECT_CLASS)
    return PointTruth(classes, instances, is_moving)


def speeds_of(track_ids: Int, velocities_m_s: Float64) -> dict[int, float]:
    """Return the speed of each object by its instance, which is its track id plus one."""
    speeds = np.linalg.norm(velocities_m_s, axis=1)
    return dict(zip((track_ids + 1).tolist(), speeds.tolist(), strict=True))
