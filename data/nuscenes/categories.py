"""Categories of nuScenes as the types of KITTI's labels, and as SemanticKITTI's classes of points."""

from data.labelled_objects import ObjectCategory

_PERSON, _OTHER = ObjectCategory("Pedestrian", 30), ObjectCategory("Misc", 99)
_OTHER_VEHICLE = ObjectCategory("Misc", 20)

# By the beginning of the name, the longest that fits. KITTI knows no bus: buses are trucks. A bicycle is labelled
# together with its rider, and whether it has one stands in its attribute.
_CATEGORIES = {
    "noise": ObjectCategory(None, 1),
    "animal": _OTHER,
    "human": _PERSON,
    "human.pedestrian.stroller": _OTHER,
    "human.pedestrian.wheelchair": _OTHER,
    "movable_object": _OTHER,
    "static_object": _OTHER,
    "vehicle": _OTHER_VEHICLE,
    "vehicle.bicycle": ObjectCategory("Misc", 11),
    "vehicle.bus": ObjectCategory("Truck", 13),
    "vehicle.car": ObjectCategory("Car", 10),
    "vehicle.ego": ObjectCategory(None, 0),
    "vehicle.emergency.ambulance": ObjectCategory("Van", 18),
    "vehicle.emergency.police": ObjectCategory("Car", 10),
    "vehicle.motorcycle": ObjectCategory("Misc", 15),
    "vehicle.truck": ObjectCategory("Truck", 18),
    "flat.driveable_surface": ObjectCategory(None, 40),
    "flat.other": ObjectCategory(None, 49),
    "flat.sidewalk": ObjectCategory(None, 48),
    "flat.terrain": ObjectCategory(None, 72),
    "static.manmade": ObjectCategory(None, 50),
    "static.other": ObjectCategory(None, 99),
    "static.vegetation": ObjectCategory(None, 70),
}
_WITH_RIDER = {
    "vehicle.bicycle": ObjectCategory("Cyclist", 31),
    "vehicle.motorcycle": ObjectCategory("Cyclist", 32),
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
    if name in _WITH_RIDER and _RIDDEN in attributes:
        return _WITH_RIDER[name]
    words = name.split(".")
    for count in range(len(words), 0, -1):
        if (start := ".".join(words[:count])) in _CATEGORIES:
            return _CATEGORIES[start]
    return _OTHER
