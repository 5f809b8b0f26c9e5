"""ASAM OpenLABEL: objects by id, and in each frame a cuboid of 10 numbers with a quaternion, or 9 with Euler angles.

A frame is named by the file of its point cloud where its properties state one, else by its number.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from data.box_labels.boxes import (
    AXES,
    Frames,
    LabelForm,
    LabelledBox,
    LabelledFrame,
    Record,
    as_record,
    entry,
    has,
    numbers_of,
    rounded,
    write_document,
)
from data.clouds.read_cloud import CLOUD_SUFFIXES
from perception.errors import LabelError

_LENGTHS = (9, 10)


def _read(path: Path, document: Any) -> Frames:  # noqa: ANN401 - a JSON document
    content = _part(document, "openlabel", path)
    named = _part(content, "objects", path)
    frames: dict[str, list[LabelledBox]] = {}
    for number, value in _part(content, "frames", path).items():
        frame = as_record(value, f"{path} frame {number}")
        boxes = frames.setdefault(_cloud_of(frame) or number, [])
        for track, one in _part(frame, "objects", f"{path} frame {number}").items():
            where = f"{path} frame {number} object {track}"
            kind = entry(entry(named, track, where), "type", where)
            for cuboid in _part(as_record(one, where), "object_data", where).get("cuboid") or ():
                boxes.append(LabelledBox(where, str(kind), track, _numbers(cuboid, where)))
    return frames


def _part(record: Record, name: str, where: str | Path) -> Record:
    """Return the record of a name in another, empty without one."""
    return as_record(record.get(name) or {}, f"{where} {name}")


def _numbers(cuboid: Any, where: str) -> tuple[float, ...]:  # noqa: ANN401 - of a document
    values = entry(cuboid, "val", where)
    if not isinstance(values, list) or len(values) not in _LENGTHS:
        found = f"{len(values)}" if isinstance(values, list) else type(values).__name__
        raise LabelError(where, expected="a cuboid of 9 or 10 numbers", found=found)
    numbers = numbers_of(values, range(len(values)), where)
    turn = np.array(numbers[3:-3])
    if not np.isfinite(turn).all() or (len(turn) == 4 and not np.linalg.norm(turn) > 0):
        raise LabelError(where, expected="a rotation", found=str(turn.tolist()))
    rotation = Rotation.from_quat(turn) if len(turn) == 4 else Rotation.from_euler("xyz", turn)
    forward = rotation.as_matrix()[:, 0]
    return (*numbers[:3], *numbers[-3:], float(np.arctan2(forward[1], forward[0])))


def _cloud_of(frame: Any) -> str | None:  # noqa: ANN401 - of a document
    """Return the name of a point cloud in the properties of a frame, without its suffix."""
    files = (PurePosixPath(text) for text in _texts(frame.get("frame_properties", {})))
    return next((one.stem for one in files if one.suffix.lower() in CLOUD_SUFFIXES), None)


def _texts(value: object) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, (dict, list)):
        for one in value.values() if isinstance(value, dict) else value:
            yield from _texts(one)


def _write(out: Path, frames: Sequence[LabelledFrame]) -> None:
    """Write objects with their ids; a box without a track is an object of its own."""
    named: dict[str, dict[str, str]] = {}
    listed: dict[str, dict[str, object]] = {}
    for frame in frames:
        objects: dict[str, object] = {}
        for number, one in enumerate(frame.boxes):
            key = one.track or f"{frame.number}-{number}"
            named.setdefault(key, {"name": key, "type": one.kind})
            turn = (0.0, 0.0, np.sin(one.numbers[6] / 2), np.cos(one.numbers[6] / 2))
            values = rounded((*one.numbers[:3], *turn, *one.numbers[3:6]))
            objects[key] = {"object_data": {"cuboid": [{"name": "shape", "val": values}]}}
        streams = {"lidar": {"uri": frame.scan}}
        properties = {"timestamp": frame.stamp_us / 1e6, "streams": streams}
        listed[str(frame.number)] = {"objects": objects, "frame_properties": properties}
    content = {"metadata": {"schema_version": "1.0.0"}, "objects": named, "frames": listed}
    write_document(out / "openlabel.json", {"openlabel": content})


OPENLABEL = LabelForm(
    "ASAM OpenLABEL", lambda document: has(document, "openlabel"), _read, AXES, _write
)
