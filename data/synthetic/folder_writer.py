"""Synthetic drives as folders with a drive.yaml, which hold any number of cameras.

NNNN/drive.yaml  scans/NNNNNN.bin  CAMERA/NNNNNN.png  point_labels/NNNNNN.label  times.txt  poses.txt  labels.txt
     truth_labels.txt  truth_poses.txt  sensor.json

`poses.txt` holds the poses of the LiDAR by the INS, the other files what they hold in KITTI's layouts; `labels.txt` is
of the main camera.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

from data.folder.config import FILE_NAME
from data.kitti.labels import format_tracking_labels
from data.synthetic.drive import SyntheticDrive
from data.synthetic.rig import camera_calibration
from data.synthetic.writer import (
    FrameFolders,
    format_poses,
    truth_labels,
    truth_poses,
    write_frames,
)
from perception.atomic_file import write_atomically
from perception.sensor import sensor_to_json
from perception.types import Calibration


def write_folder(drive: SyntheticDrive, out: Path, number: int, done: Callable[[], object]) -> Path:
    """Write a drive as a folder of scans; return the folder.

    Args:
        drive: Drive to write.
        out: Folder in which the folder of the drive is made.
        number: Number of the drive.
        done: Function called after each frame.
    """
    folder = out / f"{number:04d}"
    images = tuple(folder / camera for camera in drive.cameras)
    folders = FrameFolders(folder / "scans", folder / "point_labels", images)
    labels = []
    calibration = _at_optical_centre(drive.calibration)
    stems = {index: f"{index:06d}" for index in range(len(drive))}
    for index, frame in write_frames(drive, stems, folders, is_tracking=True):
        labels.append(format_tracking_labels(index, frame.labels, calibration))
        done()
    times = "".join(f"{drive.stamp_s(index):.9f}\n" for index in stems)
    poses = np.stack([drive.world_SE3_velo(index)[:3] for index in stems])
    write_atomically(folder / "sensor.json", sensor_to_json(drive.sensor).encode())
    write_atomically(folder / "times.txt", times.encode())
    write_atomically(folder / "poses.txt", format_poses(poses).encode())
    write_atomically(folder / "labels.txt", "".join(labels).encode())
    write_atomically(folder / "truth_labels.txt", truth_labels(drive, calibration))
    write_atomically(folder / "truth_poses.txt", truth_poses(drive))
    write_atomically(folder / FILE_NAME, _description(drive).encode())
    return folder


def _description(drive: SyntheticDrive) -> str:
    """Return the text of drive.yaml."""
    description: dict[str, object] = {
        "lidar": {
            "scans": "scans",
            "sensor": "sensor.json",
            "timestamps": "times.txt",
            "point_labels": "point_labels",
        },
        "poses": {"file": "poses.txt", "format": "kitti"},
        "labels": "labels.txt",
    }
    if drive.has_images:
        description["cameras"] = {
            name: _camera(name, _at_optical_centre(camera_calibration(name)))
            for name in drive.cameras
        }
    else:
        del description["labels"]  # which need the calibration of a camera
    text: str = yaml.safe_dump(description, sort_keys=False)
    return text


def _at_optical_centre(calibration: Calibration) -> Calibration:
    """Return the same camera with the origin of its frame at the optical centre, as a folder describes it."""
    matrix, offset = calibration.image_P_cam[:, :3], calibration.image_P_cam[:, 3]
    cam_SE3_velo = calibration.cam_SE3_velo.copy()
    cam_SE3_velo[:3, 3] += np.linalg.solve(matrix, offset)
    image_P_cam = np.column_stack([matrix, np.zeros(3)])
    return replace(calibration, image_P_cam=image_P_cam, cam_SE3_velo=cam_SE3_velo)


def _camera(images: str, calibration: Calibration) -> dict[str, object]:
    """Return the section of a camera."""
    projection, size_px = calibration.image_P_cam, calibration.image_size_px
    return {
        "images": images,
        "fx_px": float(projection[0, 0]),
        "fy_px": float(projection[1, 1]),
        "cx_px": float(projection[0, 2]),
        "cy_px": float(projection[1, 2]),
        "size_px": None if size_px is None else list(size_px),
        "lidar_to_camera": {"matrix": calibration.cam_SE3_velo.tolist()},
    }
