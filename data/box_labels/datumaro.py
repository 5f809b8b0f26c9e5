"""Datumaro's JSON, as CVAT exports it: items named as the clouds, with `cuboid_3d` and classes by their number."""

from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import Any

from data.box_labels.boxes import (
    AXES,
    Frames,
    LabelForm,
    LabelledBox,
    LabelledFrame,
    entry,
    has,
    numbers_in,
    records,
    rounded,
    track_name,
    write_document,
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


def _write(out: Path, frames: Sequence[LabelledFrame]) -> None:
    kinds = sorted({one.kind for frame in frames for one in frame.boxes})
    items = []
    for frame in frames:
        cuboids = [
            {
                "id": number,
                "type": "cuboid_3d",
                "label_id": kinds.index(one.kind),
                "group": 0,
                "position": rounded(one.numbers[:3]),
                "rotation": rounded((0, 0, one.numbers[6])),
                "scale": rounded(one.numbers[3:6]),
                "attributes": {"track_id": one.track} if one.track else {},
            }
            for number, one in enumerate(frame.boxes)
        ]
        cloud = {"path": frame.scan}
        items.append(
            {
                "id": frame.name,
                "annotations": cuboids,
                "attr": {"frame": frame.number},
                "point_cloud": cloud,
            }
        )
    labels = {"labels": [{"name": kind, "parent": "", "attributes": []} for kind in kinds]}
    write_document(
        out / "default.json", {"info": {}, "categories": {"label": labels}, "items": items}
    )


DATUMARO = LabelForm(
    "Datumaro", lambda document: has(document, "categories", "items"), _read, AXES, _write
)
