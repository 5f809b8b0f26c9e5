"""Annotated boxes of a scene at any time: those of the key frames, and between two of them on the way from one to the other."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from data.labelled_objects import ObjectCategory, labels_of_boxes
from data.nuscenes.scene_tables import Annotation, SceneTables
from perception.geometry.boxes import transform_boxes
from perception.geometry.se3 import inverse, wrap
from perception.types import Boxes3D, Float64, Labels

_PERSON, _OTHER = ObjectCategory("Pedestrian", 30, "pedestrian"), ObjectCategory("Misc", 99)
_OTHER_VEHICLE = ObjectCategory("Misc", 20)

# By the beginning of the name, the longest that fits. KITTI knows no bus: buses are trucks. A bicycle is labelled
# together with its rider, and whether it has one stands in its attribute.
CATEGORIES = {
    "noise": ObjectCategory(None, 1),
    "animal": _OTHER,
    "human": _PERSON,
    "human.pedestrian.personal_mobility": ObjectCategory("Pedestrian", 30),
    "human.pedestrian.stroller": _OTHER,
    "human.pedestrian.wheelchair": _OTHER,
    "movable_object": _OTHER,
    "movable_object.barrier": ObjectCategory("Misc", 99, "barrier"),
    "movable_object.trafficcone": ObjectCategory("Misc", 99, "traffic_cone"),
    "static_object": _OTHER,
    "vehicle": _OTHER_VEHICLE,
    "vehicle.bicycle": ObjectCategory("Misc", 11, "bicycle"),
    "vehicle.bus": ObjectCategory("Truck", 13, "bus"),
    "vehicle.car": ObjectCategory("Car", 10, "car"),
    "vehicle.construction": ObjectCategory("Misc", 20, "construction_vehicle"),
    "vehicle.ego": ObjectCategory(None, 0),
    "vehicle.emergency.ambulance": ObjectCategory("Van", 18),
    "vehicle.emergency.police": ObjectCategory("Car", 10),
    "vehicle.motorcycle": ObjectCategory("Misc", 15, "motorcycle"),
    "vehicle.trailer": ObjectCategory("Misc", 20, "trailer"),
    "vehicle.truck": ObjectCategory("Truck", 18, "truck"),
    "flat.driveable_surface": ObjectCategory(None, 40),
    "flat.other": ObjectCategory(None, 49),
    "flat.sidewalk": ObjectCategory(None, 48),
    "flat.terrain": ObjectCategory(None, 72),
    "static.manmade": ObjectCategory(None, 50),
    "static.other": ObjectCategory(None, 99),
    "static.vegetation": ObjectCategory(None, 70),
}
_WITH_RIDER = {
    "vehicle.bicycle": ObjectCategory("Cyclist", 31, "bicycle"),
    "vehicle.motorcycle": ObjectCategory("Cyclist", 32, "motorcycle"),
}
_RIDDEN = "cycle.with_rider"

# nuScenes-lidarseg numbers its classes so; a table of categories that states no index is an older one.
LIDARSEG_NAMES = (
    "noise", "animal", "human.pedestrian.adult", "human.pedestrian.child",
    "human.pedestrian.construction_worker", "human.pedestrian.personal_mobility",
    "human.pedestrian.police_officer", "human.pedestrian.stroller", "human.pedestrian.wheelchair",
    "movable_object.barrier", "movable_object.debris", "movable_object.pushable_pullable",
    "movable_object.trafficcone", "static_object.bicycle_rack", "vehicle.bicycle",
    "vehicle.bus.bendy", "vehicle.bus.rigid", "vehicle.car", "vehicle.construction",
    "vehicle.emergency.ambulance", "vehicle.emergency.police", "vehicle.motorcycle",
    "vehicle.trailer", "vehicle.truck", "flat.driveable_surface", "flat.other", "flat.sidewalk",
    "flat.terrain", "static.manmade", "static.other", "static.vegetation", "vehicle.ego",
)  # fmt: skip


def category(name: str, attributes: tuple[str, ...] = ()) -> ObjectCategory:
    """Return a category; one that is not of the set is an object of no type of KITTI's.

    Args:
        name: Name of the category, such as vehicle.car.
        attributes: Names of the attributes of an annotation.
    """
    if is_ridden(name, attributes):
        return _WITH_RIDER[name]
    words = name.split(".")
    for count in range(len(words), 0, -1):
        if (start := ".".join(words[:count])) in CATEGORIES:
            return CATEGORIES[start]
    return _OTHER


def is_ridden(name: str, attributes: tuple[str, ...]) -> bool:
    """Return whether a category is a cycle, and its attributes say that it has a rider."""
    return name in _WITH_RIDER and _RIDDEN in attributes


@dataclass(frozen=True)
class SceneBoxes:
    """Boxes of a scene.

    Attributes:
        tables: Tables of the scene.
    """

    tables: SceneTables

    @property
    def is_empty(self) -> bool:
        """Whether no sample has a box."""
        return not self.tables.annotations

    @cached_property
    def track_ids(self) -> Mapping[str, int]:
        """Number of each object, from 0 in the order of their names."""
        names = {box.instance for boxes in self.tables.annotations.values() for box in boxes}
        return {name: number for number, name in enumerate(sorted(names))}

    def around(self, stamp_us: int, world_SE3_velo: Float64) -> Labels:
        """Return the labels of all objects around at a time; they have no boxes in the image.

        Args:
            stamp_us: Time in microseconds.
            world_SE3_velo: (4, 4) pose of the LiDAR in the world of the tables at that time.
        """
        boxes = self._at(stamp_us)
        kinds = [category(box.category, box.attributes).kind for box in boxes]
        boxes = [box for box, kind in zip(boxes, kinds, strict=True) if kind is not None]
        return labels_of_boxes(
            transform_boxes(inverse(world_SE3_velo), _boxes_world(boxes)),
            [kind for kind in kinds if kind is not None],
            np.array([self.track_ids[box.instance] for box in boxes], np.int64),
        )

    def _at(self, stamp_us: int) -> list[Annotation]:
        samples, stamps_us = list(self.tables.stamps_us), list(self.tables.stamps_us.values())
        after = int(np.searchsorted(stamps_us, stamp_us))
        if after < len(samples) and stamps_us[after] == stamp_us:
            return list(self.tables.annotations.get(samples[after], ()))
        if after in (0, len(samples)):
            return []  # nothing is known before the first key frame and after the last
        share = (stamp_us - stamps_us[after - 1]) / (stamps_us[after] - stamps_us[after - 1])
        here = self.tables.annotations.get(samples[after - 1], ())
        there = {box.instance: box for box in self.tables.annotations.get(samples[after], ())}
        return [_between(box, there[box.instance], share) for box in here if box.instance in there]


def _between(first: Annotation, second: Annotation, share: float) -> Annotation:
    turn = (first.world_R_box.inv() * second.world_R_box).as_rotvec()
    return Annotation(
        instance=first.instance,
        category=first.category,
        attributes=first.attributes,
        centre_m=first.centre_m + share * (second.centre_m - first.centre_m),
        size_m=first.size_m,
        world_R_box=first.world_R_box * type(first.world_R_box).from_rotvec(share * turn),
    )


def _boxes_world(boxes: list[Annotation]) -> Boxes3D:
    if not boxes:
        return Boxes3D.empty()
    return upright_boxes(
        np.stack([box.centre_m for box in boxes]),
        np.stack([box.size_m for box in boxes]),
        np.stack([box.world_R_box.as_matrix() for box in boxes]),
    )


def upright_boxes(centres_m: Float64, size_m: Float64, world_R_box: Float64) -> Boxes3D:
    """Return upright boxes in the world of the tables.

    Args:
        centres_m: (M, 3) centres.
        size_m: (M, 3) length, width, height.
        world_R_box: (M, 3, 3) rotations, whose x is the heading.
    """
    return Boxes3D(
        centres_m - world_R_box[:, :, 2] * size_m[:, 2:] / 2,
        size_m,
        wrap(np.arctan2(world_R_box[:, 1, 0], world_R_box[:, 0, 0])),
    )
