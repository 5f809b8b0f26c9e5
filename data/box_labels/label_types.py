"""Types of labels by the names that labelling tools and data sets give them."""

from collections.abc import Mapping

from data.argoverse2 import annotations
from data.nuscenes.boxes import category
from perception.detection.bev.classes import BEV_CLASSES
from perception.detection.detectors.class_columns import KNOWN_CLASSES

_TYPES = {**KNOWN_CLASSES, **{name.lower(): name for name in BEV_CLASSES}}


def label_type(name: str, renamed: Mapping[str, str]) -> str:
    """Return the type of a name in any case of letters; the name itself where it is of no class.

    Args:
        name: Class as the labels name it.
        renamed: Other names for names of the labels, which come first.
    """
    of_lower = {key.lower(): value for key, value in renamed.items()}
    name = of_lower.get(name.lower(), name)
    found = _TYPES.get(name.lower())
    if found is None and "." in name:
        found = category(name.lower()).task_class
    if found is None and name.upper() in annotations.CATEGORIES:
        found = annotations.category(name.upper()).task_class
    return name if found is None else _TYPES.get(found, found)
