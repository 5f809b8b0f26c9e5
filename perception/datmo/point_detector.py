"""Moving objects straight from the points: what the obstacle stage says moves, cut into things."""

from dataclasses import dataclass

import numpy as np

from perception.datmo.cutting import CutRules, cut_moving, cut_standing
from perception.datmo.detector import DetectedObjects, SegmentedScan
from perception.geometry.footprints import Footprints, footprints_of
from perception.sensor import LidarModel
from perception.types import Float32, GroundModel, Int, PointState


@dataclass(frozen=True)
class ThingRules:
    """Which things of a scan are worth telling of.

    Attributes:
        least_points: fewer are no thing.
        standing_least_points: of a thing that stands, of which there are many and most do not matter.
    """

    least_points: int = 3
    standing_least_points: int = 5


class PointDetector:
    """Joins the moving points of a scan into things, and the standing points into others."""

    def __init__(
        self,
        sensor: LidarModel,
        cutting: CutRules | None = None,
        rules: ThingRules | None = None,
    ) -> None:
        """Take the sensor whose scans will come, and the rules."""
        self._sensor = sensor
        self._cutting = cutting or CutRules()
        self._rules = rules or ThingRules()

    def detect(self, scan: SegmentedScan) -> DetectedObjects:
        """Cut a scan into things; each begins at the ground under it."""
        moving = _points_of(scan, PointState.MOVING)
        standing = _points_of(scan, PointState.STATIC)
        return DetectedObjects(
            moving=self._moving_things(moving, scan.ground),
            standing=self._standing_things(standing, scan.ground),
        )

    def _moving_things(self, points_velo: Float32, ground: GroundModel) -> Footprints:
        thing_of = cut_moving(points_velo, self._sensor.elevation_step_rad, self._cutting)
        return _outline(points_velo, thing_of, self._rules.least_points, ground)

    def _standing_things(self, points_velo: Float32, ground: GroundModel) -> Footprints:
        thing_of = cut_standing(points_velo, self._cutting)
        return _outline(points_velo, thing_of, self._rules.standing_least_points, ground)


def _points_of(scan: SegmentedScan, state: PointState) -> Float32:
    rows = np.flatnonzero(scan.point_states == state)
    return np.asarray(scan.points_velo.take(rows, axis=0)[:, :3])


def _outline(
    points_velo: Float32, thing_of: Int, least_points: int, ground: GroundModel
) -> Footprints:
    """Outline the things of enough points; -1 is none."""
    counts = np.bincount(thing_of + 1)[1:]
    kept = counts >= least_points
    if not kept.any():
        return Footprints.empty()
    number = np.append(np.where(kept, np.cumsum(kept) - 1, -1), -1)[thing_of]
    rows = np.flatnonzero(number >= 0)
    things = footprints_of(points_velo[rows], number[rows], int(kept.sum()))
    return _on_ground(things, ground)


def _on_ground(things: Footprints, ground: GroundModel) -> Footprints:
    """Let every thing reach down to the ground: its lowest points were taken for ground."""
    low_m = np.minimum(ground.height_m(things.centroids_m), things.high_m)
    return Footprints(
        things.vertices_m,
        things.corners,
        things.centroids_m,
        low_m,
        things.high_m,
        things.points,
    )
