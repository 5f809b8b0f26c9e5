"""Annotated boxes, in the frame of the vehicle at the time of each sweep."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from data.argoverse2.tables import read_feather
from data.argoverse2.trajectory import POSE_COLUMNS, rigid_transforms
from data.labelled_objects import ObjectCategory, labels_of_boxes
from perception.errors import LabelError
from perception.geometry.boxes import transform_boxes
from perception.geometry.se3 import inverse
from perception.types import Boxes3D, Float64, Int, Labels

_CAR, _TRUCK, _BUS = (
    ObjectCategory("Car", 10, "car"),
    ObjectCategory("Truck", 18, "truck"),
    ObjectCategory("Truck", 13, "bus"),
)
_TRAILER = ObjectCategory("Misc", 20, "trailer")
_PERSON = ObjectCategory("Pedestrian", 30, "pedestrian")
_OTHER = ObjectCategory("Misc", 99)  # SemanticKITTI: other-object

# The box of a bicycle holds its rider too, in nuScenes' detection task; here a rider has one of its own.
# In the order of the dataset: scene flow numbers them from 1, and 0 is no object.
CATEGORIES = {
    "ANIMAL": _OTHER,
    "ARTICULATED_BUS": _BUS,
    "BICYCLE": ObjectCategory("Misc", 11, "bicycle"),
    "BICYCLIST": ObjectCategory("Cyclist", 31),
    "BOLLARD": ObjectCategory("Misc", 80),
    "BOX_TRUCK": _TRUCK,
    "BUS": _BUS,
    "CONSTRUCTION_BARREL": _OTHER,
    "CONSTRUCTION_CONE": ObjectCategory("Misc", 99, "traffic_cone"),
    "DOG": _OTHER,
    "LARGE_VEHICLE": _TRUCK,
    "MESSAGE_BOARD_TRAILER": _TRAILER,
    "MOBILE_PEDESTRIAN_CROSSING_SIGN": ObjectCategory("Misc", 81),
    "MOTORCYCLE": ObjectCategory("Misc", 15, "motorcycle"),
    "MOTORCYCLIST": ObjectCategory("Cyclist", 32),
    "OFFICIAL_SIGNALER": _PERSON,
    "PEDESTRIAN": _PERSON,
    "RAILED_VEHICLE": ObjectCategory("Tram", 16),
    "REGULAR_VEHICLE": _CAR,
    "SCHOOL_BUS": _BUS,
    "SIGN": ObjectCategory("Misc", 81),
    "STOP_SIGN": ObjectCategory("Misc", 81),
    "STROLLER": _OTHER,
    "TRAFFIC_LIGHT_TRAILER": _TRAILER,
    "TRUCK": _TRUCK,
    "TRUCK_CAB": _TRUCK,
    "VEHICULAR_TRAILER": _TRAILER,
    "WHEELCHAIR": _OTHER,
    "WHEELED_DEVICE": _OTHER,
    "WHEELED_RIDER": ObjectCategory("Cyclist", 31),
}
_SIZE_COLUMNS = ("length_m", "width_m", "height_m")
_COLUMNS = ("timestamp_ns", "track_uuid", "category", *_SIZE_COLUMNS, *POSE_COLUMNS)


def category(name: str) -> ObjectCategory:
    """Return a category; one that is not of the dataset is an object of no type of KITTI's."""
    return CATEGORIES.get(name, _OTHER)


def flow_point_classes() -> Int:
    """Return (31,) SemanticKITTI's class of each class of scene flow; that of no object is `other-object`, too."""
    return np.array([_OTHER.point_class, *(one.point_class for one in CATEGORIES.values())])


@dataclass(frozen=True)
class Annotations:
    """R boxes of a log.

    Attributes:
        stamps_ns: (R,) time of the sweep.
        track_ids: (R,) number of the track, from 0 in the order of its names.
        categories: (R,) category.
        boxes_ego: (R) boxes in the frame of the vehicle.
    """

    stamps_ns: Int
    track_ids: Int
    categories: NDArray[Any]
    boxes_ego: Boxes3D

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read the boxes of a log.

        Raises:
            LabelError: The table is missing or damaged, or a box is no box.
        """
        table = read_feather(path, _COLUMNS, LabelError, "annotated boxes")
        poses = rigid_transforms(table, LabelError)
        size_m = table.numbers(*_SIZE_COLUMNS)
        if not (np.isfinite(size_m).all() and (size_m > 0).all()):
            raise LabelError(
                path, expected="boxes with a size", found="a length that is not above 0"
            )
        bottom_m = poses[:, :3, 3] - poses[:, :3, 2] * size_m[:, 2:] / 2
        yaw_rad = np.arctan2(poses[:, 1, 0], poses[:, 0, 0])
        ids = np.unique(table["track_uuid"], return_inverse=True)[1]
        return cls(
            np.asarray(table["timestamp_ns"], np.int64),
            np.asarray(ids, np.int64).reshape(-1),
            table["category"],
            Boxes3D(bottom_m, size_m, yaw_rad),
        )

    @cached_property
    def moments_ns(self) -> list[int]:
        """Times at which there are boxes, rising."""
        return [int(stamp) for stamp in np.unique(self.stamps_ns)]

    @cached_property
    def _rows(self) -> dict[int, Int]:
        order = np.argsort(self.stamps_ns, kind="stable")
        stamps, starts = np.unique(self.stamps_ns[order], return_index=True)
        return dict(zip(stamps.tolist(), np.split(order, starts[1:]), strict=True))

    def rows_at(self, stamp_ns: int) -> Int:
        """Return the rows of a sweep."""
        return self._rows.get(stamp_ns, np.zeros(0, np.int64))

    def at(self, stamp_ns: int, ego_SE3_velo: Float64) -> Labels:
        """Return the boxes around the vehicle at the time of a sweep; they have no boxes in the image."""
        rows = self.rows_at(stamp_ns)
        boxes_velo = transform_boxes(inverse(ego_SE3_velo), self.boxes_ego[rows])
        types = [str(category(str(name)).kind) for name in self.categories[rows]]
        return labels_of_boxes(boxes_velo, types, self.track_ids[rows])

    def task_classes(self, stamp_ns: int) -> NDArray[np.str_]:
        """Return the class of each of these boxes in nuScenes' detection task; empty of what it does not count."""
        names = self.categories[self.rows_at(stamp_ns)]
        return np.array([category(str(name)).task_class or "" for name in names], np.str_)
