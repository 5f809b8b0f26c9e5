"""Supervisely's episodes: `annotation.json` with figures by frame, and beside it the cloud of each frame."""

import math
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import Any

from data.box_labels.boxes import (
    AXES,
    Frames,
    LabelForm,
    LabelledBox,
    LabelledFrame,
    as_record,
    entry,
    has,
    named,
    numbers_in,
    read_content,
    records,
    write_document,
)

_CLOUDS = "frame_pointcloud_map.json"
_FIELDS = {"position": ("x", "y", "z"), "dimensions": ("x", "y", "z"), "rotation": ("z",)}


def _read(path: Path, document: Any) -> Frames:  # noqa: ANN401 - a JSON document
    beside = path.with_name(_CLOUDS)
    clouds = as_record(read_content(beside), beside) if beside.is_file() else {}
    kinds = {
        entry(one, "key", str(path)): str(entry(one, "classTitle", str(path)))
        for one in records(document, "objects", path)
    }
    frames: dict[str, list[LabelledBox]] = {}
    for frame in records(document, "frames", path):
        index = str(entry(frame, "index", str(path)))
        boxes = frames.setdefault(PurePosixPath(str(clouds.get(index, index))).stem, [])
        for number, figure in enumerate(
            records(frame, "figures", f"{path} frame {index}"), start=1
        ):
            where = f"{path} frame {index} figure {number}"
            if figure.get("geometryType") != "cuboid_3d":
                continue
            shape, track = entry(figure, "geometry", where), entry(figure, "objectKey", where)
            numbers = numbers_in(shape, _FIELDS, where)
            boxes.append(LabelledBox(where, entry(kinds, track, where), str(track), numbers))
    return frames


def _write(out: Path, frames: Sequence[LabelledFrame]) -> None:
    kinds: dict[str, str] = {}
    listed = []
    for index, frame in enumerate(frames):
        figures = []
        for number, one in enumerate(frame.boxes):
            key = one.track or f"{index}-{number}"
            kinds.setdefault(key, one.kind)
            # Lengths are along the axes of the box, of which y is forward.
            length, width, height = one.numbers[3:6]
            geometry = {
                "position": named("x y z", one.numbers[:3]),
                "rotation": named("x y z", (0, 0, one.numbers[6] - math.pi / 2)),
                "dimensions": named("x y z", (width, length, height)),
            }
            figures.append(
                {
                    "key": f"{index}-{number}",
                    "objectKey": key,
                    "geometryType": "cuboid_3d",
                    "geometry": geometry,
                }
            )
        listed.append({"index": index, "figures": figures})
    objects = [{"key": key, "classTitle": kind, "tags": []} for key, kind in kinds.items()]
    document = {
        "description": "",
        "key": "trifuse",
        "tags": [],
        "framesCount": len(frames),
        "objects": objects,
        "frames": listed,
    }
    write_document(out / "annotation.json", document)
    write_document(out / _CLOUDS, {str(index): frame.scan for index, frame in enumerate(frames)})


SUPERVISELY = LabelForm(
    "Supervisely", lambda document: has(document, "objects", "frames"), _read, AXES, _write
)
