"""Calibration of KITTI-360: three texts, the same for all drives.

image  <-P_rect-  rectified camera 0  <-R_rect_00-  camera 0  -calib_cam_to_velo->  LiDAR
                                                    camera 0  -calib_cam_to_pose->  IMU
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from data.kitti.calibration import CalibrationText, read_perspective_camera
from data.kitti.reading import read_number_rows
from perception.errors import CalibrationError
from perception.geometry.se3 import from_rotation_translation, is_rigid
from perception.types import Calibration, Float64

CAM_TO_VELO, CAM_TO_POSE, PERSPECTIVE = (
    "calib_cam_to_velo.txt", "calib_cam_to_pose.txt", "perspective.txt",
)  # fmt: skip
_TOLERANCE = 1e-2  # of rotations


@dataclass(frozen=True)
class RigCalibration:
    """Calibration of one perspective camera, and places of the LiDAR on the vehicle.

    Attributes:
        camera: Calibration of the camera, or None where a file of it is missing.
        imu_SE3_velo: (4, 4) LiDAR to IMU, whose poses poses.txt states, or None where a file of it is missing.
    """

    camera: Calibration | None
    imu_SE3_velo: Float64 | None

    @classmethod
    def read(cls, folder: Path, camera: str) -> "RigCalibration":
        """Read the files that there are.

        Args:
            folder: Folder of the files.
            camera: Name of the camera: image_00 is the left one, image_01 the right one.

        Raises:
            CalibrationError: A file lacks a key, or a matrix cannot be used.
        """
        if not (folder / CAM_TO_VELO).is_file():
            return cls(None, None)
        # A true inverse: the rotations of the files are orthonormal to their printed digits only.
        cam0_SE3_velo = np.asarray(
            np.linalg.inv(_read_cam_to_velo(folder / CAM_TO_VELO)), np.float64
        )
        seen = imu_SE3_velo = None
        if (folder / PERSPECTIVE).is_file():
            number = camera.removeprefix("image_")
            seen = read_perspective_camera(folder / PERSPECTIVE, number, cam0_SE3_velo)
        if (folder / CAM_TO_POSE).is_file():
            cam_to_pose = CalibrationText.read(folder / CAM_TO_POSE).matrix(("image_00",), (3, 4))
            imu_SE3_cam0 = from_rotation_translation(cam_to_pose[:, :3], cam_to_pose[:, 3])
            imu_SE3_velo = _rigid(imu_SE3_cam0, folder / CAM_TO_POSE) @ cam0_SE3_velo
        return cls(seen, imu_SE3_velo)


def missing_files(folder: Path) -> list[str]:
    """Return the names of the files that a folder of calibrations lacks."""
    names = (CAM_TO_VELO, CAM_TO_POSE, PERSPECTIVE)
    return [name for name in names if not (folder / name).is_file()]


def _read_cam_to_velo(path: Path) -> Float64:
    rows = read_number_rows(path, 12, CalibrationError)
    if len(rows) != 1:
        raise CalibrationError(path, expected="one row of 12 numbers", found=f"{len(rows)} rows")
    matrix = rows[0].reshape(3, 4)
    return _rigid(from_rotation_translation(matrix[:, :3], matrix[:, 3]), path)


def _rigid(transform: Float64, path: Path) -> Float64:
    if not is_rigid(transform, _TOLERANCE):
        expected, found = "a rotation in columns 1 to 3 of the matrix", "another matrix"
        raise CalibrationError(path, expected=expected, found=found)
    return transform
