"""Places of the sensors on the vehicle, and the camera.

The frame of the vehicle has x forward, y left, z up, and its origin at the centre of the rear axle. The released
images are rectified: the intrinsic matrix alone projects into them, and the coefficients of the distortion, which the
tables state as well, describe the lens before.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from data.argoverse2.tables import read_feather
from data.argoverse2.trajectory import read_poses
from perception.errors import CalibrationError, UsageError
from perception.geometry.se3 import from_rotation_translation, inverse
from perception.types import Calibration, Float64

LIDAR = "up_lidar"
DEFAULT_CAMERA = "ring_front_center"
AXLE_HEIGHT_M = (
    0.36  # of the rear axle's centre over the road; the ground of real sweeps (measured)
)

_INTRINSICS = ("sensor_name", "fx_px", "fy_px", "cx_px", "cy_px", "height_px", "width_px")


@dataclass(frozen=True)
class Sensors:
    """Sensors of a log.

    Attributes:
        folder: Folder of the calibration.
        ego_SE3_sensor: (4, 4) pose of each sensor on the vehicle by name.
    """

    folder: Path
    ego_SE3_sensor: Mapping[str, Float64]

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read the places of the sensors.

        Raises:
            CalibrationError: The table is missing or damaged, or the LiDAR is not in it.
        """
        path = folder / "egovehicle_SE3_sensor.feather"
        names, poses = read_poses(
            path, "sensor_name", CalibrationError, "the places of the sensors"
        )
        sensors = cls(folder, dict(zip(names.astype(str).tolist(), poses, strict=True)))
        if LIDAR not in sensors.ego_SE3_sensor:
            raise CalibrationError(
                path, expected=f"the place of {LIDAR}", found=", ".join(names) or "no sensor"
            )
        return sensors

    @property
    def ego_SE3_velo(self) -> Float64:
        """(4, 4) place of the upper LiDAR, with the axes of the vehicle, along which the sweeps are given."""
        return from_rotation_translation(np.eye(3), self.ego_SE3_sensor[LIDAR][:3, 3])

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the cameras."""
        return tuple(name for name in self.ego_SE3_sensor if not name.endswith("_lidar"))

    def camera(self, name: str) -> Calibration:
        """Return the calibration of a camera.

        Raises:
            UsageError: There is no such camera.
            CalibrationError: The table of the cameras is missing or damaged, or lacks this one.
        """
        if name not in self.cameras:
            raise UsageError(
                f"--camera {name}", expected=f"one of {', '.join(self.cameras)}", found=name
            )
        path = self.folder / "intrinsics.feather"
        table = read_feather(path, _INTRINSICS, CalibrationError, "the cameras")
        (rows,) = np.nonzero(table["sensor_name"] == name)
        if not len(rows):
            raise CalibrationError(path, expected=f"a row of {name}", found="none")
        numbers = table.numbers(*_INTRINSICS[1:])[rows[0]]
        fx_px, fy_px, cx_px, cy_px, height_px, width_px = numbers.tolist()
        image_P_cam = np.array([[fx_px, 0, cx_px, 0], [0, fy_px, cy_px, 0], [0, 0, 1.0, 0]])
        cam_SE3_velo = inverse(self.ego_SE3_sensor[name]) @ self.ego_SE3_velo
        size_px = (int(width_px), int(height_px))
        return Calibration(image_P_cam, cam_SE3_velo, size_px, source=f"{path} {name}")
