"""Classes that the bird's-eye view tells apart, and the types of labels that are of each."""

from collections.abc import Mapping, Sequence

BEV_CLASSES: Mapping[str, tuple[str, ...]] = {
    "Car": ("car",),
    "Van": ("van",),
    "Truck": ("truck",),
    "Bus": ("bus",),
    "Trailer": ("trailer",),
    "Pedestrian": ("pedestrian", "person_sitting"),
    "Cyclist": ("cyclist",),
    "Motorcycle": ("motorcycle",),
    "Bicycle": ("bicycle",),
}
VEHICLES = 0  # group of those with flat sides
# Of the classes of one group, one object is at a place.
GROUPS: Mapping[str, int] = {
    **dict.fromkeys(("Car", "Van", "Truck", "Bus", "Trailer"), VEHICLES),
    **dict.fromkeys(("Cyclist", "Motorcycle", "Bicycle"), 1),
    "Pedestrian": 2,
}
SYNTHETIC_CLASSES = tuple(BEV_CLASSES)


def class_numbers(types: Sequence[str], class_names: Sequence[str]) -> list[int]:
    """Return the index of the class of each type of a label; -1 of a type of no such class."""
    number_of = {
        kind: number for number, name in enumerate(class_names) for kind in BEV_CLASSES[name]
    }
    return [number_of.get(name.lower(), -1) for name in types]
