"""nuScenes' tables beside scans of one's own: annotations of samples in the world, and the scan of each sample with its pose.

A sample is the key frame of its LiDAR, named by its file. Boxes are in the axes of the scans where the tables have no
poses of the vehicle.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from data.box_labels.boxes import (
    Frames,
    LabelForm,
    LabelledBox,
    LabelledFrame,
    Reading,
    Record,
    as_stated,
    entry,
    has,
    numbers_in,
    read_content,
    records,
    rounded,
    write_document,
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
        for where, one in _rows(
            path.with_name("sample_data.json"), [*tables["sample_data"].values()]
        )
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
    rows = records({"rows": content}, "rows", path)
    return [(f"{path} record {number}", one) for number, one in enumerate(rows, start=1)]


def _is_cloud(name: str) -> bool:
    return PurePosixPath(name).suffix.lower() in CLOUD_SUFFIXES


def _name(file: str) -> str:
    """Return the name of a scan, as `FrameFiles` has it."""
    return PurePosixPath(file).stem


def _write(out: Path, frames: Sequence[LabelledFrame]) -> None:
    """Write the tables of one scene, whose scans lie in samples/LIDAR_TOP; boxes without a track are objects of their own."""
    kinds = {kind: f"category-{kind}" for kind in sorted({b.kind for f in frames for b in f.boxes})}
    tables: dict[str, list[Record]] = {
        name: [] for name in (*TABLES, "sample_annotation") if name != "lidarseg"
    }
    tables["category"] = [
        {"token": token, "name": kind, "description": ""} for kind, token in kinds.items()
    ]
    tables["sensor"] = [{"token": "lidar", "channel": "LIDAR_TOP", "modality": "lidar"}]
    tables["calibrated_sensor"] = [
        {**_record("lidar", np.eye(4)), "sensor_token": "lidar", "camera_intrinsic": []}
    ]
    samples = [f"sample-{frame.name}" for frame in frames]
    ends = {"first_sample_token": samples[0], "last_sample_token": samples[-1]} if samples else {}
    tables["scene"] = [
        {
            "token": "scene",
            "name": "scene-0000",
            "log_token": "log",
            "nbr_samples": len(frames),
            "description": "",
            **ends,
        }
    ]
    tables["log"] = [
        {"token": "log", "logfile": "", "vehicle": "", "date_captured": "", "location": ""}
    ]
    instances: dict[str, list[dict[str, Any]]] = {}
    for place, (frame, token) in enumerate(zip(frames, samples, strict=True)):
        links = {
            "prev": samples[place - 1] if place else "",
            "next": samples[place + 1] if place + 1 < len(samples) else "",
        }
        tables["sample"].append(
            {"token": token, "timestamp": frame.stamp_us, "scene_token": "scene", **links}
        )
        tables["ego_pose"].append(
            {**_record(token, frame.world_SE3_file), "timestamp": frame.stamp_us}
        )
        data = {
            "filename": f"samples/LIDAR_TOP/{frame.scan}",
            "fileformat": "",
            "is_key_frame": True,
            "width": 0,
            "height": 0,
        }
        owners = {
            "sample_token": token,
            "ego_pose_token": token,
            "calibrated_sensor_token": "lidar",
        }
        tables["sample_data"].append(
            {"token": token, "timestamp": frame.stamp_us, **owners, **data, **links}
        )
        for number, box in enumerate(frame.boxes):
            key = f"instance-{box.track}" if box.track else f"instance-{frame.name}-{number}"
            x, y, z, length, width, height, heading = box.numbers
            turn = Rotation.from_euler("z", heading).as_matrix()
            pose = from_rotation_translation(turn, np.array([x, y, z]))
            record = {
                **_record(f"annotation-{frame.name}-{number}", frame.world_SE3_file @ pose),
                "size": rounded((width, length, height)), "sample_token": token, "instance_token": key,
                "attribute_tokens": [], "visibility_token": "", "prev": "", "next": "", "category": box.kind,
            }  # fmt: skip
            instances.setdefault(key, []).append(record)
    for key, ones in instances.items():
        for first, second in pairwise(ones):
            first["next"], second["prev"] = second["token"], first["token"]
        ends = {
            "first_annotation_token": ones[0]["token"],
            "last_annotation_token": ones[-1]["token"],
        }
        category = {"category_token": kinds[ones[0]["category"]], "nbr_annotations": len(ones)}
        tables["instance"].append({"token": key, **category, **ends})
        tables["sample_annotation"] += [
            {k: v for k, v in one.items() if k != "category"} for one in ones
        ]
    for name, table in tables.items():
        write_document(out / f"{name}.json", table)


def _record(token: str, pose: Float64) -> dict[str, Any]:
    """Return a record of a pose."""
    x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
    translation = rounded(pose[:3, 3])
    return {"token": token, "translation": translation, "rotation": [w, x, y, z]}


NUSCENES_TABLES = LabelForm(
    "nuScenes' tables", _is_of, _read, (Reading("x forward", as_stated),), _write, names_frames=True
)
