"""SUSTechPOINTS: a JSON file a scan, a list of objects with `psr`: position of the centre, scale, and rotation in rad."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from data.box_labels.boxes import (
    Frames,
    LabelForm,
    LabelledBox,
    LabelledFrame,
    Reading,
    as_stated,
    entry,
    has,
    named,
    numbers_in,
    track_name,
    write_document,
)

_FIELDS = {"position": ("x", "y", "z"), "scale": ("x", "y", "z"), "rotation": ("z",)}


def _objects(document: Any) -> Any:  # noqa: ANN401 - of a document
    return document["objs"] if has(document, "objs") else document


def _is_of(document: Any) -> bool:  # noqa: ANN401 - any document
    boxes = _objects(document)
    return isinstance(boxes, list) and all(has(one, "psr") for one in boxes[:1])


def _read(path: Path, document: Any) -> Frames:  # noqa: ANN401 - a JSON document
    boxes = []
    for number, one in enumerate(_objects(document), start=1):
        where = f"{path} object {number}"
        numbers = numbers_in(entry(one, "psr", where), _FIELDS, where)
        kind, track = entry(one, "obj_type", where), track_name(one.get("obj_id"))
        boxes.append(LabelledBox(where, str(kind), track, numbers))
    return {"": boxes}


def _write(out: Path, frames: Sequence[LabelledFrame]) -> None:
    for frame in frames:
        objects = [
            {
                "obj_id": one.track,
                "obj_type": one.kind,
                "psr": {
                    "position": named("x y z", one.numbers[:3]),
                    "scale": named("x y z", one.numbers[3:6]),
                    "rotation": named("x y z", (0, 0, one.numbers[6])),
                },
            }
            for one in frame.boxes
        ]
        write_document(out / f"{frame.name}.json", objects)


SUSTECHPOINTS = LabelForm(
    "SUSTechPOINTS", _is_of, _read, (Reading("x forward", as_stated),), _write, is_per_scan=True
)
