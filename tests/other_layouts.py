"""One synthetic drive in the layouts of other data sets, with points that each of them carries to the last bit."""

import json
from pathlib import Path

import cv2
import numpy as np
import pyarrow
from pyarrow import feather
from scipy.spatial.transform import Rotation

from data.argoverse2.annotations import CATEGORIES
from data.nuscenes.boxes import LIDARSEG_NAMES
from data.nuscenes.scans import SENSOR_R_VELO
from data.synthetic.drive import CachedDrive
from data.synthetic.lidar import LidarScan
from data.synthetic.writer import semantic_kitti_labels, write_tracking
from perception.evaluation.ground import GROUND_CLASSES
from perception.geometry.se3 import from_rotation_translation, inverse
from perception.sensor import VLP_16, sensor_to_json
from perception.types import Labels, PointTruth
from tests.tiny_drive import TinyDrive

FRAMES = 4
FIRST_NS = 315966265000000000
PERIOD_NS = 100_000_000
EGO_SE3_VELO = from_rotation_translation(np.eye(3), np.array([1.25, 0.0, 1.5]))
SIZE_PX = (1242, 375)
_GRID_M = 2.0**-10  # coordinates that survive a shift by the place of the LiDAR
_FLOW_NAMES = {"Car": "REGULAR_VEHICLE", "Van": "REGULAR_VEHICLE", "Truck": "TRUCK", "Tram": "RAILED_VEHICLE",
               "Pedestrian": "PEDESTRIAN", "Person_sitting": "PEDESTRIAN", "Cyclist": "BICYCLIST", "Misc": "MOTORCYCLE"}  # fmt: skip
_SCENE_NAMES = {"Car": "vehicle.car", "Van": "vehicle.car", "Truck": "vehicle.truck", "Tram": "vehicle.truck",
                "Pedestrian": "human.pedestrian.adult", "Person_sitting": "human.pedestrian.adult",
                "Cyclist": "vehicle.bicycle", "Misc": "vehicle.motorcycle"}  # fmt: skip
_LIDARSEG_OF = {10: "vehicle.car", 11: "vehicle.bicycle", 13: "vehicle.bus.rigid", 15: "vehicle.motorcycle",
                18: "vehicle.truck", 20: "vehicle.trailer", 30: "human.pedestrian.adult", 31: "vehicle.bicycle",
                32: "vehicle.motorcycle", 40: "flat.driveable_surface", 44: "flat.driveable_surface",
                48: "flat.sidewalk", 49: "flat.other", 60: "flat.driveable_surface", 72: "flat.terrain",
                50: "static.manmade", 51: "static.manmade", 52: "static.manmade", 70: "static.vegetation",
                71: "static.vegetation"}  # fmt: skip


class GridDrive(CachedDrive):
    """A synthetic drive whose points lie on a grid, and whose reflectances are steps of 1/255."""

    def scan(self, index: int) -> LidarScan:
        exact = super().scan(index)
        points = exact.points_velo.copy()
        points[:, :3] = np.round(points[:, :3] / _GRID_M) * _GRID_M
        points[:, 3] = np.round(points[:, 3] * 255).astype(np.float32) / np.float32(255)
        return LidarScan(points, exact.truth)


def grid_drive(frames: int = FRAMES) -> GridDrive:
    """Return a drive of a sensor of few beams."""
    return GridDrive(frames, seed=3, sensor=VLP_16)


def stamp_ns(index: int) -> int:
    """Return the time of a scan."""
    return FIRST_NS + index * PERIOD_NS


def write_kitti(root: Path, drive: CachedDrive) -> Path:
    """Write KITTI's tracking layout; return its root."""
    write_tracking(drive, root, 0, lambda: None)
    return root


def write_table(path: Path, columns: dict[str, object]) -> None:
    """Write a feather table."""
    path.parent.mkdir(parents=True, exist_ok=True)
    feather.write_feather(pyarrow.table(columns), str(path))


def write_image(path: Path, size_px: tuple[int, int] = SIZE_PX) -> None:
    """Write a grey image."""
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.full((size_px[1], size_px[0], 3), 90, np.uint8))


def _pose_columns(poses: list[np.ndarray]) -> dict[str, object]:
    quaternions = Rotation.from_matrix([pose[:3, :3] for pose in poses]).as_quat()
    places = np.array([pose[:3, 3] for pose in poses])
    named = dict(zip(("qx", "qy", "qz", "qw"), quaternions.T, strict=True))
    return named | dict(zip(("tx_m", "ty_m", "tz_m"), places.T, strict=True))


def _box_poses(labels: Labels) -> list[np.ndarray]:
    """Return dst_SE3_box of the centres of boxes."""
    boxes = labels.boxes_velo
    turns = Rotation.from_euler("z", boxes.yaw_rad[:, None]).as_matrix() if len(labels) else []
    return [
        from_rotation_translation(turn, bottom + np.array([0, 0, size[2] / 2]))
        for turn, bottom, size in zip(turns, boxes.bottom_m, boxes.size_m, strict=True)
    ]


def write_argoverse2(
    root: Path, drive: CachedDrive | TinyDrive, *, images: bool = True, flow: bool = True
) -> Path:
    """Write a log as Argoverse 2 has it, with coordinates in float32; return it."""
    log = root / "7fab2350-0000-3b7e-a39d-000000000000"
    camera = drive.calibration
    cam_SE3_ego = camera.cam_SE3_velo @ inverse(EGO_SE3_VELO)
    names, places = ["ring_front_center", "up_lidar"], [np.linalg.inv(cam_SE3_ego), EGO_SE3_VELO]
    calibration = log / "calibration"
    write_table(
        calibration / "egovehicle_SE3_sensor.feather",
        {"sensor_name": names, **_pose_columns(places)},
    )
    P = camera.image_P_cam
    intrinsics = {"fx_px": P[0, 0], "fy_px": P[1, 1], "cx_px": P[0, 2], "cy_px": P[1, 2], "k1": 0.1,
                  "height_px": SIZE_PX[1], "width_px": SIZE_PX[0]}  # fmt: skip
    write_table(
        calibration / "intrinsics.feather",
        {"sensor_name": names[:1], **{name: [value] for name, value in intrinsics.items()}},
    )
    poses = [drive.world_SE3_velo(i) @ inverse(EGO_SE3_VELO) for i in range(len(drive))]
    stamps = [stamp_ns(i) for i in range(len(drive))]
    write_table(
        log / "city_SE3_egovehicle.feather", {"timestamp_ns": stamps, **_pose_columns(poses)}
    )
    for index in range(len(drive)):
        write_sweep(log, drive, index)
        if images:
            name = f"{stamp_ns(index) + 7_000_000}.jpg"
            write_image(log / "sensors/cameras/ring_front_center" / name)
        if flow:
            table = _flow_columns(drive, index)
            write_table(log / f"flow_labels/{stamp_ns(index)}.feather", table)
    _write_boxes(log, drive)
    return log


def write_sweep(log: Path, drive: CachedDrive | TinyDrive, index: int) -> None:
    """Write one sweep."""
    points = drive.scan(index).points_velo
    ego = points[:, :3] + EGO_SE3_VELO[:3, 3].astype(np.float32)
    elevations = np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]))
    lasers = np.abs(elevations[:, None] - drive.sensor.elevations_rad[None]).argmin(axis=1)
    columns = dict(zip("xyz", ego.T, strict=True)) | {
        "intensity": np.round(points[:, 3] * 255).astype(np.uint8),
        "laser_number": lasers.astype(np.uint8),
        "offset_ns": np.zeros(len(points), np.int32),
    }
    write_table(log / f"sensors/lidar/{stamp_ns(index)}.feather", columns)


def _write_boxes(log: Path, drive: CachedDrive | TinyDrive) -> None:
    rows: dict[str, list[object]] = {
        name: [] for name in ("timestamp_ns", "track_uuid", "category")
    }
    sizes, poses = [], []
    for index in range(len(drive)):
        labels = drive.labels_around(index)
        rows["timestamp_ns"] += [stamp_ns(index)] * len(labels)
        rows["track_uuid"] += [f"{track:08d}-uuid" for track in labels.track_ids]
        rows["category"] += [_FLOW_NAMES[kind] for kind in labels.types.tolist()]
        sizes.append(labels.boxes_velo.size_m)
        poses += [EGO_SE3_VELO @ pose for pose in _box_poses(labels)]
    size_columns = dict(
        zip(("length_m", "width_m", "height_m"), np.concatenate(sizes).T, strict=True)
    )
    write_table(log / "annotations.feather", {**rows, **size_columns, **_pose_columns(poses)})


def _flow_columns(drive: CachedDrive | TinyDrive, index: int) -> dict[str, object]:
    truth, labels = drive.point_truth(index), drive.labels_around(index)
    number_of = {name: number for number, name in enumerate(CATEGORIES, start=1)}
    known = zip(labels.track_ids.tolist(), labels.types.tolist(), strict=True)
    of_instance = {track + 1: number_of[_FLOW_NAMES[kind]] for track, kind in known}
    classes = np.array([of_instance.get(one, 0) for one in truth.instances.tolist()], np.uint8)
    return {
        "classes": classes,
        "dynamic": truth.is_moving,
        "is_ground_0": np.isin(truth.classes, GROUND_CLASSES),
    }


def write_nuscenes(root: Path, drive: CachedDrive | TinyDrive, *, images: bool = True) -> Path:
    """Write a scene as nuScenes has it: every second scan is a key frame with boxes and point labels; return the root."""
    tables = _SceneWriter(root, drive)
    for index in range(len(drive)):
        tables.add_scan(index)
        if images:
            tables.add_image(index)
    tables.write()
    return root


class _SceneWriter:
    """Collects the records of one scene."""

    def __init__(self, root: Path, drive: CachedDrive | TinyDrive) -> None:
        self.root, self.drive = root, drive
        ego_SE3_sensor = EGO_SE3_VELO.copy()
        ego_SE3_sensor[:3, :3] = SENSOR_R_VELO.T
        camera = drive.calibration
        cam_SE3_ego = camera.cam_SE3_velo @ inverse(EGO_SE3_VELO)
        self.records: dict[str, list[dict[str, object]]] = {
            "scene": [{"token": "scene-a", "name": "scene-0061"}, {"token": "b", "name": "scene-0103"}],
            "sensor": [{"token": "s-lidar", "channel": "LIDAR_TOP"}, {"token": "s-cam", "channel": "CAM_FRONT"},
                       {"token": "s-radar", "channel": "RADAR_FRONT"}],
            "calibrated_sensor": [
                {"token": "c-lidar", "sensor_token": "s-lidar", "camera_intrinsic": [], **_transform(ego_SE3_sensor)},
                {"token": "c-cam", "sensor_token": "s-cam", "camera_intrinsic": camera.image_P_cam[:, :3].tolist(),
                 **_transform(np.linalg.inv(cam_SE3_ego))},
            ],
            "attribute": [{"token": "rides", "name": "cycle.with_rider"}],
            "category": [{"token": f"k-{n}", "name": name, "index": n} for n, name in enumerate(LIDARSEG_NAMES)],
            "instance": [], "sample": [{"token": "other", "scene_token": "b", "timestamp": 1}], "sample_data": [],
            "ego_pose": [], "sample_annotation": [], "lidarseg": [],
        }  # fmt: skip
        self.known: set[int] = set()

    def add_scan(self, index: int) -> None:
        points = self.drive.scan(index).points_velo
        raw = np.zeros((len(points), 5), np.float32)
        raw[:, :3] = points[:, :3] @ SENSOR_R_VELO.T.astype(np.float32)
        raw[:, 3] = np.round(points[:, 3] * 255)
        name = f"{'samples' if index % 2 == 0 else 'sweeps'}/LIDAR_TOP/scan_{index}.pcd.bin"
        _write(self.root / name, raw.tobytes())
        self._add_data(index, f"d-{index}", "c-lidar", name, index % 2 == 0, 0)
        if index % 2 == 0:
            self.records["sample"].append(
                {"token": f"sample-{index}", "scene_token": "scene-a", "timestamp": _us(index)}
            )
            self._add_labels(index)

    def add_image(self, index: int) -> None:
        name = f"samples/CAM_FRONT/image_{index}.jpg"
        write_image(self.root / name)
        self._add_data(index, f"i-{index}", "c-cam", name, index % 2 == 0, 12_000)

    def _add_data(
        self, index: int, token: str, sensor: str, name: str, is_key: bool, late_us: int
    ) -> None:
        pose = self.drive.world_SE3_velo(index) @ inverse(EGO_SE3_VELO)
        self.records["ego_pose"].append(
            {"token": f"p-{token}", "timestamp": _us(index), **_transform(pose)}
        )
        sample = f"sample-{index if is_key else min(index + 1, _last_key(self.drive))}"
        width, height = SIZE_PX if sensor == "c-cam" else (0, 0)
        self.records["sample_data"].append(
            {"token": token, "sample_token": sample, "ego_pose_token": f"p-{token}", "calibrated_sensor_token": sensor,
             "timestamp": _us(index) + late_us, "is_key_frame": is_key, "filename": name, "width": width,
             "height": height})  # fmt: skip

    def _add_labels(self, index: int) -> None:
        labels, world_SE3_velo = self.drive.labels_around(index), self.drive.world_SE3_velo(index)
        for row, pose in enumerate(_box_poses(labels)):
            track, kind = int(labels.track_ids[row]), str(labels.types[row])
            if track not in self.known:
                self.known.add(track)
                number = LIDARSEG_NAMES.index(_SCENE_NAMES[kind])
                self.records["instance"].append(
                    {"token": f"o-{track:04d}", "category_token": f"k-{number}"}
                )
            length, width, height = labels.boxes_velo.size_m[row].tolist()
            self.records["sample_annotation"].append(
                {"token": f"a-{index}-{track}", "sample_token": f"sample-{index}", "instance_token": f"o-{track:04d}",
                 "attribute_tokens": ["rides"] if kind == "Cyclist" else [], "size": [width, length, height],
                 **_transform(world_SE3_velo @ pose)})  # fmt: skip
        name = f"lidarseg/v1.0-mini/d-{index}_lidarseg.bin"
        _write(self.root / name, lidarseg_numbers(self.drive.point_truth(index)).tobytes())
        self.records["lidarseg"].append(
            {"token": f"l-{index}", "sample_data_token": f"d-{index}", "filename": name}
        )

    def write(self) -> None:
        for name, records in self.records.items():
            _write(self.root / f"v1.0-mini/{name}.json", json.dumps(records, indent=0).encode())


def lidarseg_numbers(truth: PointTruth) -> np.ndarray:
    """Return (N,) nuScenes' numbers of the classes of points."""
    numbers = np.full(256, LIDARSEG_NAMES.index("static.other"), np.uint8)
    numbers[0] = 0
    for number, name in _LIDARSEG_OF.items():
        numbers[number] = LIDARSEG_NAMES.index(name)
    return numbers[truth.classes]


def _last_key(drive: CachedDrive | TinyDrive) -> int:
    return (len(drive) - 1) // 2 * 2


def _us(index: int) -> int:
    return stamp_ns(index) // 1000


def _transform(pose: np.ndarray) -> dict[str, object]:
    x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
    return {"translation": pose[:3, 3].tolist(), "rotation": [w, x, y, z]}


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


def leave_out_instances(root: Path) -> Path:
    """Leave the numbers of objects out of SemanticKITTI's labels in a folder; return the folder."""
    for file in root.rglob("*.label"):
        (np.fromfile(file, np.uint32) & 0xFFFF).tofile(file)
    return root


def write_semantic_kitti(
    root: Path, drive: CachedDrive | TinyDrive, *, images: bool = True
) -> Path:
    """Write a sequence as SemanticKITTI has it; return the folder of the set."""
    folder = root / "dataset" / "sequences" / "08"
    camera = drive.calibration
    keys = {"P0": camera.image_P_cam, "P2": camera.image_P_cam, "Tr": camera.cam_SE3_velo[:3]}
    text = "".join(
        f"{key}: {' '.join(map(repr, matrix.ravel().tolist()))}\n" for key, matrix in keys.items()
    )
    _write(folder / "calib.txt", text.encode())
    velo_SE3_cam = np.linalg.inv(camera.cam_SE3_velo)
    poses = [
        camera.cam_SE3_velo @ drive.world_SE3_velo(i) @ velo_SE3_cam for i in range(len(drive))
    ]
    rows = [" ".join(map(repr, pose[:3].ravel().tolist())) for pose in poses]
    _write(folder / "poses.txt", "\n".join(rows).encode())
    _write(
        folder / "times.txt", "".join(f"{drive.stamp_s(i):e}\n" for i in range(len(drive))).encode()
    )
    _write(folder / "sensor.json", sensor_to_json(drive.sensor).encode())
    for index in range(len(drive)):
        _write(folder / f"velodyne/{index:06d}.bin", drive.scan(index).points_velo.tobytes())
        _write(
            folder / f"labels/{index:06d}.label",
            semantic_kitti_labels(drive.point_truth(index)).tobytes(),
        )
        if images:
            write_image(folder / f"image_2/{index:06d}.png")
    return root


def write_all(root: Path) -> None:
    """Write one drive in every layout, in a folder each."""
    drive = grid_drive()
    write_kitti(root / "KITTI", drive)
    write_argoverse2(root / "Argoverse 2", drive)
    write_nuscenes(root / "nuScenes", drive)
    write_semantic_kitti(root / "SemanticKITTI", drive)
