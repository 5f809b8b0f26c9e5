"""Classes that the bird's-eye view tells apart, and the types of labels that are of each."""

from collections.abc import Mapping, Sequence

# Cars come first: where a class is asked for by default, it is one that synthetic drives have.
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
SYNTHETIC_CLASSES = ("Car", "Van", "Truck", "Bus", "Trailer", "Pedestrian", "Cyclist")


def class_numbers(types: Sequence[str], class_names: Sequence[str]) -> list[int]:
    """Return the index of the class of each type of a label; -1 of a type of no such class."""
    number_of = {
        kind: number for number, name in enumerate(class_names) for kind in BEV_CLASSES[name]
    }
    return [number_of.get(name.lower(), -1) for name in types]
