"""A synthetic drive as KITTI-360 is downloaded: scans, images, poses, calibration, boxes."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from data.synthetic.drive import CachedDrive
from perception.geometry.boxes import transform_boxes
from perception.geometry.camera import project
from perception.geometry.se3 import from_euler, from_rotation_translation, inverse
from perception.types import Boxes3D
from tests.tiny_drive import TinyDrive

NAME = "2013_05_28_drive_0000_sync"
FIRST = 5  # number of the first scan
# The world of the file, far from the origin and turned; the IMU has x forward, y right and z down.
FILE_SE3_WORLD = from_euler(0.0, 0.0, 0.7, np.array([1200.0, -800.0, 115.0]))
_IMU_AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
IMU_SE3_CAM0 = from_rotation_translation(
    _IMU_AXES @ from_euler(0.01, 0.02, -0.03)[:3, :3], np.array([1.57, 0.0, -0.65])
)
R_RECT = from_euler(0.004, -0.006, 0.008)
BASELINE_M = 0.6
LABELS = {"Car": "car", "Van": "car", "Truck": "truck", "Tram": "train", "Pedestrian": "person",
          "Person_sitting": "person", "Cyclist": "rider", "Misc": "unknownVehicle"}  # fmt: skip
_CUBE = np.array([[x, y, z] for x in (0.5, -0.5) for y in (0.5, -0.5) for z in (0.5, -0.5)])
_FACES = np.array([[0, 2, 1], [2, 3, 1], [4, 6, 5]], np.int32)


@dataclass(frozen=True)
class Kitti360Object:
    """An object of the XML.

    Attributes:
        label: Name of its class.
        instance: Number of the object within its class.
        box: (1) box in the world of the file.
        frame: Frame of a box that moves, -1 of a static one.
        window: First and last frame of the window in which it was annotated.
    """

    label: str
    instance: int
    box: Boxes3D
    frame: int
    window: tuple[int, int]


def true_pose(drive: CachedDrive | TinyDrive, index: int) -> np.ndarray:
    """Return file_SE3_velo."""
    is_exact = isinstance(drive, TinyDrive)
    pose = drive.world_SE3_velo(index) if is_exact else drive.true_world_SE3_velo(index)
    return FILE_SE3_WORLD @ pose


def write_kitti360(
    root: Path,
    drive: CachedDrive | TinyDrive,
    *,
    scans: Collection[int] | None = None,
    posed: Collection[int] | None = None,
    images: bool = True,
) -> Path:
    """Write a drive; return the folder of the set.

    Args:
        root: Folder of the set.
        drive: Drive; its frames are numbered from `FIRST`.
        scans: Indices of the frames that have a scan and an image; all by default.
        posed: Indices of the frames that have a pose; all by default.
        images: Whether there are images.
    """
    indices = range(len(drive))
    scans, posed = (indices if one is None else sorted(one) for one in (scans, posed))
    _write_calibration(root / "calibration", drive)
    for index in scans:
        path = root / f"data_3d_raw/{NAME}/velodyne_points/data/{FIRST + index:010d}.bin"
        _write(path, drive.scan(index).points_velo.tobytes())
    rows = [_clock(drive.stamp_s(0) + (row - FIRST) / 10) for row in range(FIRST)]
    rows += [_clock(drive.stamp_s(index)) for index in indices]
    times = "".join(f"{row}\n" for row in rows)
    _write(root / f"data_3d_raw/{NAME}/velodyne_points/timestamps.txt", times)
    if images:
        _write_images(root / "data_2d_raw" / NAME, drive, scans, times)
    _write_poses(root / "data_poses" / NAME, drive, posed)
    window = (FIRST, FIRST + len(drive) - 1)
    write_boxes(root / f"data_3d_bboxes/train/{NAME}.xml", objects_of(drive, window))
    return root


def _clock(stamp_s: float) -> str:
    nanoseconds = round((30.123456789 + stamp_s) * 1e9)
    return f"2013-05-28 08:46:{nanoseconds // 10**9:02d}.{nanoseconds % 10**9:09d}"


def _write_calibration(folder: Path, drive: CachedDrive | TinyDrive) -> None:
    camera = drive.calibration
    cam0_SE3_velo = inverse(R_RECT) @ camera.cam_SE3_velo
    right = camera.image_P_cam.copy()
    right[0, 3] -= right[0, 0] * BASELINE_M
    cameras = {
        "S_rect_00": np.array(camera.image_size_px), "R_rect_00": R_RECT[:3, :3], "P_rect_00": camera.image_P_cam,
        "S_rect_01": np.array(camera.image_size_px), "R_rect_01": R_RECT[:3, :3], "P_rect_01": right,
    }  # fmt: skip
    _write(folder / "perspective.txt", _keys(cameras))
    _write(folder / "calib_cam_to_pose.txt", _keys({"image_00": IMU_SE3_CAM0[:3]}))
    _write(folder / "calib_cam_to_velo.txt", _row(np.linalg.inv(cam0_SE3_velo)[:3]))


def _write_images(
    folder: Path, drive: CachedDrive | TinyDrive, scans: Collection[int], times: str
) -> None:
    """Write images of the left camera in which the points are white, and folders of the fisheye cameras."""
    width, height = drive.calibration.image_size_px
    for index in scans:
        image = np.zeros((height, width), np.uint8)
        columns, rows = points_px(drive.calibration.image_P_velo, drive.scan(index).points_velo)
        image[rows, columns] = 255
        path = folder / f"image_00/data_rect/{FIRST + index:010d}.png"
        _write(path, cv2.imencode(".png", image)[1].tobytes())
    _write(folder / "image_00/timestamps.txt", times)
    for name in ("image_02", "image_03"):
        _write(folder / name / "timestamps.txt", times)
        _write(folder / name / f"data_rgb/{FIRST:010d}.png", b"")


def points_px(image_P_velo: np.ndarray, points_velo: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return columns and rows of the pixels of the points that the camera sees."""
    pixels, depths = project(image_P_velo, points_velo[:, :3])
    with np.errstate(invalid="ignore"):
        is_seen = (depths > 1) & ((pixels >= 0) & (pixels < (1242, 375))).all(axis=1)
    columns, rows = np.floor(pixels[is_seen]).astype(int).T
    return columns, rows


def _write_poses(folder: Path, drive: CachedDrive | TinyDrive, posed: Collection[int]) -> None:
    camera = drive.calibration
    velo_SE3_imu = inverse(IMU_SE3_CAM0 @ inverse(R_RECT) @ camera.cam_SE3_velo)
    imu = [f"{FIRST + i} {_row((true_pose(drive, i) @ velo_SE3_imu)[:3])}" for i in posed]
    cam = [f"{FIRST + i} {_row(true_pose(drive, i) @ inverse(camera.cam_SE3_velo))}" for i in posed]
    _write(folder / "poses.txt", "".join(imu))
    _write(folder / "cam0_to_world.txt", "".join(cam))


def objects_of(drive: CachedDrive | TinyDrive, window: tuple[int, int]) -> list[Kitti360Object]:
    """Return the objects around: once where they are static, else at each frame."""
    boxes: dict[tuple[str, int], dict[int, Boxes3D]] = {}
    for index in range(len(drive)):
        labels = drive.labels_around(index)
        world = transform_boxes(true_pose(drive, index), labels.boxes_velo)
        for row, track in enumerate(labels.track_ids.tolist()):
            name = (LABELS[str(labels.types[row])], track + 1)
            boxes.setdefault(name, {})[FIRST + index] = world[row : row + 1]
    objects = [Kitti360Object("road", 0, _flat(window[0]), -1, window)]
    for (label, instance), by_frame in boxes.items():
        places = np.concatenate([box.bottom_m for box in by_frame.values()])
        is_static = np.ptp(places, axis=0).max() < 1e-3
        first = next(iter(by_frame.items()))
        for frame, box in [(-1, first[1])] if is_static else by_frame.items():
            objects.append(Kitti360Object(label, instance, box, frame, window))
    return objects


def _flat(number: int) -> Boxes3D:
    return Boxes3D(np.array([[float(number), 0.0, 0.0]]), np.array([[50.0, 9.0, 0.1]]), np.zeros(1))


def write_boxes(path: Path, objects: Sequence[Kitti360Object]) -> None:
    """Write objects by OpenCV, as the set was."""
    path.parent.mkdir(parents=True, exist_ok=True)
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for number, one in enumerate(objects, start=1):
        (bottom_m,), (size_m,), (yaw_rad,) = one.box.bottom_m, one.box.size_m, one.box.yaw_rad
        centre_m = bottom_m + np.array([0.0, 0.0, size_m[2] / 2])
        transform = from_euler(0.0, 0.0, yaw_rad, centre_m)
        transform[:3, :3] *= size_m
        storage.startWriteStruct(f"object{number}", cv2.FileNode_MAP)
        storage.write("index", number)
        storage.write("label", one.label)
        storage.write("semanticId", 13)
        storage.write("instanceId", one.instance)
        storage.write("timestamp", one.frame)
        storage.write("dynamic", int(one.frame >= 0))
        storage.write("start_frame", one.window[0])
        storage.write("end_frame", one.window[1])
        storage.write("transform", transform)
        storage.write("vertices", _CUBE.astype(np.float32))
        storage.write("faces", _FACES)
        storage.endWriteStruct()
    storage.release()


def _keys(matrices: dict[str, np.ndarray]) -> str:
    return "".join(f"{key}: {_row(matrix)}" for key, matrix in matrices.items())


def _row(matrix: np.ndarray) -> str:
    return " ".join(map(repr, matrix.ravel().tolist())) + "\n"


def _write(path: Path, content: bytes | str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
