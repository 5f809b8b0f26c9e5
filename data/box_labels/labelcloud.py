"""labelCloud: a JSON file a scan, boxes by centre, lengths and angles, or by eight corners.

Angles are in degrees (`centroid_abs`) or rad (`centroid_rel`). Of the corners, 0 to 3 are the bottom, in a row; the
object faces the side of 2 and 3.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from data.box_labels.boxes import (
    Frames,
    LabelForm,
    LabelledBox,
    LabelledFrame,
    Reading,
    as_stated,
    entry,
    has,
    in_degrees,
    named,
    numbers_in,
    numbers_of,
    records,
    write_document,
)
from perception.errors import LabelError

_FIELDS = {
    "centroid": ("x", "y", "z"),
    "dimensions": ("length", "width", "height"),
    "rotations": ("z",),
}


def _is_of(document: Any) -> bool:  # noqa: ANN401 - any document
    if not has(document, "objects") or not isinstance(document["objects"], list):
        return False
    boxes = document["objects"]
    shaped = has(boxes[0], "centroid") or has(boxes[0], "vertices") if boxes else True
    return shaped and has(document, "filename")


def _read(path: Path, document: Any) -> Frames:  # noqa: ANN401 - a JSON document
    boxes = []
    for number, one in enumerate(records(document, "objects", path), start=1):
        where = f"{path} object {number}"
        if has(one, "vertices"):
            numbers = _of_corners(one["vertices"], where)
        else:
            numbers = numbers_in(one, _FIELDS, where)
        boxes.append(LabelledBox(where, str(entry(one, "name", where)), "", numbers))
    return {"": boxes}


def _of_corners(vertices: Any, where: str) -> tuple[float, ...]:  # noqa: ANN401 - of a document
    corners = np.array(
        [numbers_of(entry(vertices, row, where), (0, 1, 2), where) for row in range(8)]
    )
    if not np.isfinite(corners).all():
        raise LabelError(where, expected="eight corners of finite numbers", found="NaN or infinity")
    low, high = corners[:4].mean(axis=0), corners[4:].mean(axis=0)
    forward = corners[[2, 3, 6, 7]].mean(axis=0) - corners[[0, 1, 4, 5]].mean(axis=0)
    across = corners[[1, 2, 5, 6]].mean(axis=0) - corners[[0, 3, 4, 7]].mean(axis=0)
    lengths = [float(np.linalg.norm(side)) for side in (forward, across, high - low)]
    # The form has degrees where it has angles.
    heading = float(np.degrees(np.arctan2(forward[1], forward[0])))
    return (*corners.mean(axis=0).tolist(), *lengths, heading)


def _write(out: Path, frames: Sequence[LabelledFrame]) -> None:
    for frame in frames:
        objects = [
            {
                "name": one.kind,
                "centroid": named("x y z", one.numbers[:3]),
                "dimensions": named("length width height", one.numbers[3:6]),
                "rotations": named("x y z", (0, 0, math.degrees(one.numbers[6]) % 360)),
            }
            for one in frame.boxes
        ]
        document = {"folder": "", "filename": frame.scan, "path": frame.scan, "objects": objects}
        write_document(out / f"{frame.name}.json", document)


LABELCLOUD = LabelForm(
    "labelCloud",
    _is_of,
    _read,
    (Reading("angles in degrees", in_degrees), Reading("angles in rad", as_stated)),
    _write,
    is_per_scan=True,
)
