"""Truth of points: labels of scene flow where a log has them, else boxes and the map of the ground.

- The class of a point is that of the box around it. Points without a box are ground where the map says so, else
  another object.
- A box moves where it is displaced by `_MIN_STEP_M` from one sweep to the next over the ground: the threshold of the
  dataset's own labels.
- A point that is both in a box and near the ground belongs to either: it has no label.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from data.argoverse2.annotations import Annotations, category, flow_point_classes
from data.argoverse2.ground_map import GroundMap
from data.argoverse2.tables import FeatherTable, read_feather
from data.argoverse2.trajectory import Trajectory
from data.labelled_objects import box_owners
from perception.errors import LabelError
from perception.geometry.boxes import transform_boxes
from perception.geometry.se3 import inverse
from perception.types import Bool, Float32, Float64, Int, PointTruth

FLOW_FILE, FLOW_FOLDER = "flow_labels.feather", "flow_labels"
_FLOW_COLUMNS = ("classes", "dynamic", "is_ground_0")
_OTHER_NAMES = {"classes": "category_indices", "dynamic": "is_dynamic", "is_ground_0": "is_ground"}
_UNLABELLED, _GROUND, _OTHER = 0, 49, 99  # SemanticKITTI: other-ground, other-object
_MIN_STEP_M = 0.05  # of a moving box from sweep to sweep


@dataclass(frozen=True)
class TruthSources:
    """What a log knows of its points.

    Attributes:
        flow_files: File of scene flow by the time of its sweep.
        annotations: Boxes, or None.
        trajectory: Poses of the vehicle.
        ground: Height of the ground, or None.
        ego_SE3_velo: (4, 4) place of the LiDAR.
    """

    flow_files: dict[int, Path]
    annotations: Annotations | None
    trajectory: Trajectory
    ground: GroundMap | None
    ego_SE3_velo: Float64

    @property
    def is_empty(self) -> bool:
        """Whether no point has a truth."""
        return not self.flow_files and (self.annotations is None or self.ground is None)

    def of(self, stamp_ns: int, points_velo: Float32) -> PointTruth | None:
        """Return the truth of the points of a sweep, or None where the log has none of this sweep.

        Raises:
            LabelError: A file is damaged, or its length differs from that of the sweep.
        """
        owners = self._owners(stamp_ns, points_velo)
        if stamp_ns in self.flow_files:
            return _flow_truth(self.flow_files[stamp_ns], owners, self._instances(stamp_ns, owners))
        if (
            self.annotations is None
            or self.ground is None
            or not len(self.annotations.rows_at(stamp_ns))
        ):
            return None
        rows = self.annotations.rows_at(stamp_ns)
        moves = self._moves(stamp_ns)
        is_object = owners >= 0
        names = self.annotations.categories[rows].tolist()
        classes_of = np.array([category(name).point_class for name in names], np.int64)
        city_SE3_velo = self.trajectory.in_city(stamp_ns) @ self.ego_SE3_velo
        points_city = points_velo[:, :3] @ city_SE3_velo[:3, :3].T + city_SE3_velo[:3, 3]
        is_ground = self.ground.is_ground(points_city)
        classes = np.where(is_object, classes_of[owners], np.where(is_ground, _GROUND, _OTHER))
        classes[is_object & is_ground] = _UNLABELLED
        return PointTruth(
            classes, self._instances(stamp_ns, owners), np.asarray(is_object & moves[owners])
        )

    def _owners(self, stamp_ns: int, points_velo: Float32) -> Int:
        """Return (N,) the row of the box around each point, among those of the sweep; -1 without one."""
        if self.annotations is None:
            return np.full(len(points_velo), -1)
        boxes_ego = self.annotations.boxes_ego[self.annotations.rows_at(stamp_ns)]
        boxes = transform_boxes(inverse(self.ego_SE3_velo), boxes_ego)
        return box_owners(boxes, points_velo)

    def _instances(self, stamp_ns: int, owners: Int) -> Int:
        if self.annotations is None:
            return np.zeros(len(owners), np.int64)
        ids = np.append(self.annotations.track_ids[self.annotations.rows_at(stamp_ns)], -1)
        return np.asarray(ids[owners] + 1)

    def _moves(self, stamp_ns: int) -> Bool:
        """Return (M,) which boxes of a sweep are displaced until the next annotated one, or since the one before."""
        assert self.annotations is not None
        moments = self.annotations.moments_ns
        place = moments.index(stamp_ns)
        other_ns = moments[place + 1] if place + 1 < len(moments) else moments[max(place - 1, 0)]
        here, there = self._in_world(stamp_ns), self._in_world(other_ns)
        steps_m = [
            float(np.linalg.norm(there[track] - position)) if track in there else 0.0
            for track, position in here.items()
        ]
        return np.append(np.array(steps_m) >= _MIN_STEP_M, False)

    def _in_world(self, stamp_ns: int) -> dict[int, Float64]:
        """Return the (3,) position of each track."""
        assert self.annotations is not None
        rows = self.annotations.rows_at(stamp_ns)
        boxes = transform_boxes(
            self.trajectory.world_SE3_ego(stamp_ns), self.annotations.boxes_ego[rows]
        )
        return dict(zip(self.annotations.track_ids[rows].tolist(), boxes.bottom_m, strict=True))


def _flow_truth(path: Path, owners: Int, instances: Int) -> PointTruth:
    table = read_feather(path, _FLOW_COLUMNS, LabelError, "labels of scene flow", _OTHER_NAMES)
    _check_flow(table, len(owners))
    numbers, is_ground = (
        np.asarray(table["classes"], np.int64),
        np.asarray(table["is_ground_0"], bool),
    )
    classes = flow_point_classes()[numbers]
    classes[(numbers == 0) & is_ground] = _GROUND
    classes[(numbers > 0) & is_ground] = _UNLABELLED
    is_object = numbers > 0
    return PointTruth(
        classes, np.where(is_object, instances, 0), np.asarray(table["dynamic"], bool)
    )


def _check_flow(table: FeatherTable, points: int) -> None:
    if len(table) != points:
        raise LabelError(
            table.path, expected=f"a label for each of {points} points", found=f"{len(table)} rows"
        )
    numbers = table["classes"]
    known = len(flow_point_classes())
    if len(numbers) and not (numbers.min() >= 0 and numbers.max() < known):
        raise LabelError(
            table.path,
            expected=f"classes from 0 to {known - 1}",
            found=f"{numbers.min()} to {numbers.max()}",
        )
