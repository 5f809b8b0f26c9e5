"""nuScenes' tables beside scans of one's own: annotations of samples in the world, and the scan of each sample with its pose.

A sample is the key frame of its LiDAR, named by its file. Boxes are in the axes of the scans where the tables have no
poses of the vehicle.
"""

from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from data.box_labels.boxes import (
    Frames,
    LabelForm,
    LabelledBox,
    Reading,
    Record,
    as_stated,
    entry,
    has,
    numbers_in,
    read_content,
)
from data.clouds.read_cloud import CLOUD_SUFFIXES
from data.nuscenes.boxes import is_ridden
from perception.errors import LabelError
from perception.geometry.se3 import from_rotation_translation, inverse
from perception.types import Float64

TABLES = (
    "attribute", "calibrated_sensor", "category", "ego_pose", "instance", "lidarseg", "log", "map", "sample",
    "sample_data", "scene", "sensor", "visibility",
)  # fmt: skip
_POSE = {"translation": (0, 1, 2), "rotation": (1, 2, 3, 0)}
_SIZE = {"size": (1, 0, 2)}


def _is_of(document: Any) -> bool:  # noqa: ANN401 - any document
    fields = ("sample_token", "translation", "size", "rotation")
    return isinstance(document, list) and bool(document) and has(document[0], *fields)


def _read(path: Path, document: Any) -> Frames:  # noqa: ANN401 - a JSON document
    tables = {name: _table(path.with_name(f"{name}.json")) for name in TABLES}
    scans = {
        str(entry(one, "sample_token", where)): one
        for where, one in _rows(path.with_name("sample_data.json"), tables["sample_data"].values())
        if one.get("is_key_frame", True) and _is_cloud(str(entry(one, "filename", where)))
    }
    names = {token: _name(str(one["filename"])) for token, one in scans.items()}
    frames: dict[str, list[LabelledBox]] = {name: [] for name in names.values()}
    places = {
        token: inverse(_world_SE3_lidar(one, tables, path.parent)) for token, one in scans.items()
    }
    for where, one in _rows(path, document):
        sample = str(entry(one, "sample_token", where))
        if sample not in scans:
            found = f"sample {sample} without one"
            raise LabelError(where, expected="a scan in sample_data.json", found=found)
        instance = str(one.get("instance_token", ""))
        lidar_SE3_box = places[sample] @ _pose(one, where)
        heading = float(np.arctan2(lidar_SE3_box[1, 0], lidar_SE3_box[0, 0]))
        numbers = *lidar_SE3_box[:3, 3].tolist(), *numbers_in(one, _SIZE, where), heading
        frames[names[sample]].append(
            LabelledBox(where, _kind(one, tables, where), instance, numbers)
        )
    return frames


def _kind(one: Record, tables: Mapping[str, Mapping[str, Record]], where: str) -> str:
    """Return the category of an annotation: its own, or that of its instance; of a ridden cycle, Cyclist."""
    name = one.get("category_name")
    if name is None:
        instance = entry(tables["instance"], entry(one, "instance_token", where), where)
        category = entry(tables["category"], entry(instance, "category_token", where), where)
        name = entry(category, "name", where)
    attributes = (tables["attribute"].get(token, {}).get("name") for token in one.get("attribute_tokens", ()))  # fmt: skip
    return "Cyclist" if is_ridden(str(name), tuple(map(str, attributes))) else str(name)


def _world_SE3_lidar(
    scan: Record, tables: Mapping[str, Mapping[str, Record]], folder: Path
) -> Float64:
    """Return the (4, 4) pose of a scan by the tables that there are."""
    transform = np.eye(4)
    for name in ("ego_pose", "calibrated_sensor"):
        token = scan.get(f"{name}_token")
        if tables[name] and token is not None:
            where = f"{folder / name}.json"
            transform = transform @ _pose(entry(tables[name], token, where), f"{where} {token}")
    return transform


def _pose(record: Record, where: str) -> Float64:
    numbers = numbers_in(record, _POSE, where)
    if not (np.isfinite(numbers).all() and np.linalg.norm(numbers[3:]) > 0.5):
        expected = "a translation, and a rotation as a unit quaternion"
        raise LabelError(where, expected=expected, found=", ".join(f"{one:g}" for one in numbers))
    rotation = Rotation.from_quat(numbers[3:]).as_matrix()
    return from_rotation_translation(rotation, np.array(numbers[:3]))


def _table(path: Path) -> Mapping[str, Record]:
    """Return the records of a table by their token; none of a table that is not there."""
    content = read_content(path) if path.is_file() else []
    return {str(entry(one, "token", where)): one for where, one in _rows(path, content)}


def _rows(path: Path, content: Any) -> list[tuple[str, Any]]:  # noqa: ANN401 - a JSON document
    return [(f"{path} record {number}", one) for number, one in enumerate(content, start=1)]


def _is_cloud(name: str) -> bool:
    return PurePosixPath(name).suffix.lower() in CLOUD_SUFFIXES


def _name(file: str) -> str:
    """Return the name of a scan, as `FrameFiles` has it."""
    return PurePosixPath(file).stem


NUSCENES_TABLES = LabelForm(
    "nuScenes' tables", _is_of, _read, (Reading("x forward", as_stated),), names_frames=True
)
