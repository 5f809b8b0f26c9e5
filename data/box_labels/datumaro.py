"""Datumaro's JSON, as CVAT exports it: items named as the clouds, with `cuboid_3d` and classes by their number."""

from pathlib import Path, PurePosixPath
from typing import Any

from data.box_labels.boxes import (
    AXES,
    Frames,
    LabelForm,
    LabelledBox,
    entry,
    has,
    numbers_in,
    records,
    track_name,
)

_FIELDS = {"position": (0, 1, 2), "scale": (0, 1, 2), "rotation": (2,)}


def _read(path: Path, document: Any) -> Frames:  # noqa: ANN401 - a JSON document
    categories = entry(entry(document, "categories", str(path)), "label", str(path))
    names = records(categories, "labels", path)
    frames: dict[str, list[LabelledBox]] = {}
    for item in records(document, "items", path):
        name = PurePosixPath(str(entry(item, "id", str(path)))).name
        cuboids = [
            one for one in records(item, "annotations", f"{path} item {name}")
            if one.get("type") == "cuboid_3d"
        ]  # fmt: skip
        boxes = frames.setdefault(name, [])
        for number, one in enumerate(cuboids, start=1):
            where = f"{path} item {name} cuboid {number}"
            kind = entry(entry(names, entry(one, "label_id", where), where), "name", where)
            track = track_name((one.get("attributes") or {}).get("track_id"))
            boxes.append(LabelledBox(where, str(kind), track, numbers_in(one, _FIELDS, where)))
    return frames


DATUMARO = LabelForm("Datumaro", lambda document: has(document, "categories", "items"), _read, AXES)
