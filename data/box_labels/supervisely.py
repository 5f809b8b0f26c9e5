"""Supervisely's episodes: `annotation.json` with figures by frame, and beside it the cloud of each frame."""

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
    read_content,
    records,
)

_CLOUDS = "frame_pointcloud_map.json"
_FIELDS = {"position": ("x", "y", "z"), "dimensions": ("x", "y", "z"), "rotation": ("z",)}


def _read(path: Path, document: Any) -> Frames:  # noqa: ANN401 - a JSON document
    beside = path.with_name(_CLOUDS)
    clouds = read_content(beside) if beside.is_file() else {}
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


SUPERVISELY = LabelForm(
    "Supervisely", lambda document: has(document, "objects", "frames"), _read, AXES
)
