"""Labels of the objects of a test's drive in each form, as the tools write them."""

import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from perception.geometry.boxes import corners
from tests.data.box_labels.conftest import ObjectRow, objects_of, true_boxes

_XYZ = ("x", "y", "z")


def _write(path: Path, document: object) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(document if isinstance(document, str) else json.dumps(document))


def _xyz(numbers: tuple[float, ...]) -> dict[str, float]:
    return dict(zip(_XYZ, numbers, strict=True))


def labelcloud(root: Path, frames: int, to_angle: Callable[[float], float] = math.degrees) -> None:
    for frame in range(frames):
        boxes = [
            {
                "name": one.kind.lower(),
                "centroid": _xyz(one.center_m),
                "dimensions": dict(zip(("length", "width", "height"), one.size_m, strict=True)),
                "rotations": _xyz((0, 0, to_angle(one.yaw_rad))),
            }
            for one in objects_of(frame)
        ]
        name = f"{frame:06d}"
        _write(
            root / f"labels/{name}.json",
            {"folder": "lidar", "filename": f"{name}.npy", "path": "", "objects": boxes},
        )
    _write(root / "labels/_classes.json", {"classes": []})


def labelcloud_rad(root: Path, frames: int) -> None:
    labelcloud(root, frames, float)


def labelcloud_corners(root: Path, frames: int) -> None:
    # Of our corners: front left, rear left, rear right, front right. labelCloud's arrow points at corners 2 and 3.
    order = [2, 1, 0, 3, 6, 5, 4, 7]
    for frame in range(frames):
        places = corners(true_boxes(frame))[:, order].tolist()
        boxes = [
            {"name": one.kind, "vertices": v}
            for one, v in zip(objects_of(frame), places, strict=True)
        ]
        _write(root / f"labels/{frame:06d}.json", {"filename": "", "objects": boxes})


def psr(one: ObjectRow) -> dict[str, object]:
    return {
        "obj_id": one.track,
        "obj_type": one.kind,
        "psr": {
            "position": _xyz(one.center_m),
            "scale": _xyz(one.size_m),
            "rotation": _xyz((0, 0, one.yaw_rad)),
        },
    }


def sustechpoints(root: Path, frames: int) -> None:
    for frame in range(frames):
        _write(root / f"labels/{frame:06d}.json", [psr(one) for one in objects_of(frame)])


def kitti_lidar(root: Path, frames: int) -> None:
    for frame in range(frames):
        rows = [
            f"{one.kind} 0 0 0 0 0 0 0 {one.size_m[2]} {one.size_m[1]} {one.size_m[0]} "
            f"{' '.join(map(str, one.center_m))} {one.yaw_rad}\n"
            for one in objects_of(frame)
        ]
        _write(root / f"labels/{frame:06d}.txt", "".join(rows))


def short_rows(root: Path, frames: int) -> None:
    for frame in range(frames):
        rows = [
            f"{' '.join(map(str, (*one.center_m, *one.size_m, one.yaw_rad)))} {one.kind}\n"
            for one in objects_of(frame)
        ]
        _write(root / f"labels/{frame:06d}.txt", "".join(rows))


def kitti_camera(root: Path, frames: int) -> None:
    rows = []
    for frame in range(frames):
        for one in objects_of(frame):
            x, y, z = one.center_m
            place = (-y, -(z - one.size_m[2] / 2), x)
            numbers = (*one.size_m[::-1], *place, -one.yaw_rad - math.pi / 2)
            rows.append(
                f"{frame} {one.track} {one.kind} 0 0 0 -1 -1 -1 -1 {' '.join(map(str, numbers))}\n"
            )
    _write(root / "labels/all.txt", "".join(rows))


def openlabel(root: Path, frames: int, *, along_y: bool = False) -> None:
    named = {one.track: {"name": one.kind, "type": one.kind} for one in objects_of(0)}
    content = {}
    for frame in range(frames):
        objects = {}
        for one in objects_of(frame):
            sizes, yaw = one.size_m, one.yaw_rad
            if along_y:
                sizes, yaw = (sizes[1], sizes[0], sizes[2]), yaw - math.pi / 2
            turn = (0, 0, math.sin(yaw / 2), math.cos(yaw / 2))
            cuboid = {"name": "shape", "val": [*one.center_m, *turn, *sizes]}
            objects[one.track] = {"object_data": {"cuboid": [cuboid]}}
        uri = {"streams": {"lidar": {"uri": f"lidar/{frame:06d}.npy"}}}
        content[str(frame + 5)] = {"objects": objects, "frame_properties": uri}
    _write(root / "labels/openlabel.json", {"openlabel": {"objects": named, "frames": content}})


def openlabel_along_y(root: Path, frames: int) -> None:
    openlabel(root, frames, along_y=True)


def datumaro(root: Path, frames: int) -> None:
    kinds = [one.kind for one in objects_of(0)]
    items = []
    for frame in range(frames):
        boxes = [
            {
                "type": "cuboid_3d", "label_id": kinds.index(one.kind), "position": list(one.center_m),
                "rotation": [0, 0, one.yaw_rad], "scale": list(one.size_m), "attributes": {"track_id": int(one.track)},
            }
            for one in objects_of(frame)
        ]  # fmt: skip
        items.append({"id": f"{frame:06d}", "annotations": boxes, "attr": {"frame": frame}})
    labels = {"label": {"labels": [{"name": kind} for kind in kinds]}}
    _write(root / "labels/default.json", {"info": {}, "categories": labels, "items": items})


def supervisely(root: Path, frames: int) -> None:
    objects = [{"key": f"k{one.track}", "classTitle": one.kind.upper()} for one in objects_of(0)]
    steps = []
    for frame in range(frames):
        figures = [
            {
                "key": "", "objectKey": f"k{one.track}", "geometryType": "cuboid_3d",
                "geometry": {
                    "position": _xyz(one.center_m),
                    "rotation": _xyz((0, 0, one.yaw_rad - math.pi / 2)),
                    "dimensions": _xyz((one.size_m[1], one.size_m[0], one.size_m[2])),
                },
            }
            for one in objects_of(frame)
        ]  # fmt: skip
        steps.append({"index": frame, "figures": figures})
    clouds = {str(frame): f"{frame:06d}.pcd" for frame in range(frames)}
    _write(root / "labels/annotation.json", {"objects": objects, "frames": steps})
    _write(root / "labels/frame_pointcloud_map.json", clouds)


def tracklets(root: Path, frames: int, order: str = "lwh", lift: float = -0.5) -> None:
    items = []
    for place, one in enumerate(objects_of(0)):
        sizes = dict(zip(order, one.size_m, strict=True))
        poses = ""
        for frame in range(frames):
            x, y, z = objects_of(frame)[place].center_m
            numbers = (x, y, z + lift * one.size_m[2], 0, 0, one.yaw_rad)
            names = ("tx", "ty", "tz", "rx", "ry", "rz")
            poses += (
                "<item>"
                + "".join(f"<{n}>{v}</{n}>" for n, v in zip(names, numbers, strict=True))
                + "</item>"
            )
        shape = "".join(f"<{name}>{value}</{name}>" for name, value in sizes.items())
        items.append(
            f"<item><objectType>{one.kind}</objectType>{shape}<first_frame>0</first_frame>"
            f"<poses><count>{frames}</count>{poses}</poses></item>"
        )
    _write(
        root / "labels/tracklet_labels.xml",
        '<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>\n<!DOCTYPE boost_serialization>\n'
        f"<boost_serialization><tracklets><count>{len(items)}</count>{''.join(items)}</tracklets></boost_serialization>",
    )


def tracklets_of_centres(root: Path, frames: int) -> None:
    tracklets(root, frames, lift=0.0)


def exported_tracklets(root: Path, frames: int) -> None:
    tracklets(root, frames, order="whl", lift=0.0)


WORLD = np.array([[0, -1, 0, 500.0], [1, 0, 0, -80.0], [0, 0, 1, 3.0], [0, 0, 0, 1]])
EGO = np.array([[0, 1, 0, 1.0], [-1, 0, 0, 0.0], [0, 0, 1, 1.8], [0, 0, 0, 1]])  # of the LiDAR


def _record(token: str, pose: np.ndarray, **more: object) -> dict[str, object]:
    x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
    translation = pose[:3, 3].tolist()
    return {"token": token, "translation": translation, "rotation": [w, x, y, z], **more}


def nuscenes_tables(root: Path, frames: int) -> None:
    kinds = {"Car": "vehicle.car", "Truck": "vehicle.truck", "Pedestrian": "human.pedestrian.adult"}
    names = {one.track: kinds.get(one.kind, "vehicle.bicycle") for one in objects_of(0)}
    boxes, data = [], []
    for frame in range(frames):
        for one in objects_of(frame):
            turn = Rotation.from_euler("z", one.yaw_rad).as_matrix()
            pose = np.eye(4)
            pose[:3] = np.column_stack([turn, one.center_m])
            length, width, height = one.size_m
            ridden = ["ridden"] if one.kind == "Cyclist" else []
            more = {
                "instance_token": one.track,
                "attribute_tokens": ridden,
                "size": [width, length, height],
            }
            boxes.append(_record("", WORLD @ EGO @ pose, sample_token=f"s{frame}", **more))
        tokens = {"ego_pose_token": "world", "calibrated_sensor_token": "lidar"}
        for name, is_key in (
            (f"samples/L/{frame:06d}.npy", True),
            (f"samples/C/{frame:06d}.png", True),
            ("sweeps/L/7.npy", False),
        ):
            data.append(
                {
                    "token": name,
                    "sample_token": f"s{frame}",
                    "filename": name,
                    "is_key_frame": is_key,
                    **tokens,
                }
            )
    tables = {
        "sample_annotation": boxes,
        "sample_data": data,
        "ego_pose": [_record("world", WORLD)],
        "calibrated_sensor": [_record("lidar", EGO)],
        "instance": [{"token": track, "category_token": name} for track, name in names.items()],
        "category": [{"token": name, "name": name} for name in names.values()],
        "attribute": [{"token": "ridden", "name": "cycle.with_rider"}],
    }  # fmt: skip
    for name, table in tables.items():
        _write(root / f"labels/{name}.json", table)


FORMS: Mapping[str, Callable[[Path, int], None]] = {
    one.__name__: one
    for one in (
        labelcloud, labelcloud_rad, labelcloud_corners, sustechpoints, kitti_lidar, short_rows, kitti_camera,
        openlabel, openlabel_along_y, datumaro, supervisely, tracklets, tracklets_of_centres, exported_tracklets,
        nuscenes_tables,
    )
}  # fmt: skip
TRACKED = {
    "sustechpoints",
    "kitti_camera",
    "openlabel",
    "openlabel_along_y",
    "datumaro",
    "supervisely",
    "tracklets",
    "nuscenes_tables",
}
