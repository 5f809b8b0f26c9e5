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
    numbers_of,
    records,
)

_PARTS = ("position", "scale")


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
            parts = [numbers_of(entry(one, part, where), (0, 1, 2), where) for part in _PARTS]
            turn = numbers_of(entry(one, "rotation", where), (2,), where)
            track = (one.get("attributes") or {}).get("track_id")
            boxes.append(
                LabelledBox(
                    where,
                    str(kind),
                    "" if track is None else str(track),
                    (*parts[0], *parts[1], *turn),
                )
            )
    return frames


DATUMARO = LabelForm("Datumaro", lambda document: has(document, "categories", "items"), _read, AXES)
