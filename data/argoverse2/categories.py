"""Categories of Argoverse 2 as the types of KITTI's labels, and as SemanticKITTI's classes of points.

KITTI knows no bus: buses are trucks. A bicycle is labelled apart from its rider, who is the cyclist.
"""

import numpy as np

from data.labelled_objects import ObjectCategory
from perception.types import Int

_CAR, _TRUCK, _BUS = (
    ObjectCategory("Car", 10),
    ObjectCategory("Truck", 18),
    ObjectCategory("Truck", 13),
)
_TRAILER, _PERSON = ObjectCategory("Misc", 20), ObjectCategory("Pedestrian", 30)
_OTHER = ObjectCategory("Misc", 99)  # SemanticKITTI: other-object

# In the order of the dataset: scene flow numbers them from 1, and 0 is no object.
CATEGORIES = {
    "ANIMAL": _OTHER,
    "ARTICULATED_BUS": _BUS,
    "BICYCLE": ObjectCategory("Misc", 11),
    "BICYCLIST": ObjectCategory("Cyclist", 31),
    "BOLLARD": ObjectCategory("Misc", 80),
    "BOX_TRUCK": _TRUCK,
    "BUS": _BUS,
    "CONSTRUCTION_BARREL": _OTHER,
    "CONSTRUCTION_CONE": _OTHER,
    "DOG": _OTHER,
    "LARGE_VEHICLE": _TRUCK,
    "MESSAGE_BOARD_TRAILER": _TRAILER,
    "MOBILE_PEDESTRIAN_CROSSING_SIGN": ObjectCategory("Misc", 81),
    "MOTORCYCLE": ObjectCategory("Misc", 15),
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


def category(name: str) -> ObjectCategory:
    """Return a category; one that is not of the dataset is an object of no type of KITTI's."""
    return CATEGORIES.get(name, _OTHER)


def flow_point_classes() -> Int:
    """Return (31,) SemanticKITTI's class of each class of scene flow; that of no object is `other-object`, too."""
    return np.array([_OTHER.point_class, *(one.point_class for one in CATEGORIES.values())])
