"""KITTI's calibration texts, read and written: three files a date for raw, one a sequence or frame else.

    image  <-P2-  rectified camera  <-R0_rect-  camera 0  <-Tr_velo_to_cam-  LiDAR  <-Tr_imu_to_velo-  IMU

Rows are `KEY: numbers`; the tracking benchmark spells some keys otherwise and leaves out colons.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from data.kitti.reading import read_text
from perception.errors import CalibrationError
from perception.geometry.se3 import from_rotation_translation
from perception.types import Calibration, Float, Float64

# Sets of one camera in the layout of KITTI call it P0, or just P.
_PROJECTION_KEYS = ("P2", "P0", "P")
_RECTIFICATION_KEYS = ("R0_rect", "R_rect")
_VELO_TO_CAM_KEYS = ("Tr_velo_to_cam", "Tr_velo_cam", "Tr")
_IMU_TO_VELO_KEYS = ("Tr_imu_to_velo", "Tr_imu_velo")
# Raw recordings state it; of the benchmarks, only synthetic drives do, which may have no image to ask.
_IMAGE_SIZE_KEY = "S_rect_02"
# Image sizes of KITTI's recordings by focal length in pixels; the files of the benchmarks do not state them.
_KITTI_IMAGE_SIZES_PX = {
    721.5377: (1242, 375),
    707.0493: (1224, 370),
    707.0912: (1226, 370),
    718.3351: (1238, 374),
    718.856: (1241, 376),
}

CAM_TO_CAM = "calib_cam_to_cam.txt"
VELO_TO_CAM = "calib_velo_to_cam.txt"
IMU_TO_VELO = "calib_imu_to_velo.txt"


@dataclass(frozen=True)
class DriveCalibration:
    """Calibration of a drive's camera and INS.

    Attributes:
        camera: Calibration of the left colour camera, or None where the drive states none.
        velo_SE3_imu: (4, 4) transform from the IMU to the LiDAR, or None where the drive states none.
    """

    camera: Calibration | None
    velo_SE3_imu: Float64 | None


@dataclass(frozen=True)
class CalibrationText:
    """Rows of one calibration file, parsed on access.

    Attributes:
        path: Calibration file.
        rows: Text after each key.
    """

    path: Path
    rows: Mapping[str, str]

    @classmethod
    def read(cls, path: Path) -> "CalibrationText":
        """Split the file into keys and rows.

        Raises:
            CalibrationError: The file is missing, or is not text.
        """
        lines = read_text(path, CalibrationError, "a calibration text").splitlines()
        parts = [line.split(maxsplit=1) for line in lines if line.strip()]
        return cls(path, {key.rstrip(":"): "".join(row) for key, *row in parts})

    def has(self, keys: tuple[str, ...]) -> bool:
        """Return whether the file has numbers for one of the spellings of a key."""
        return any(self.rows.get(key, "").strip() for key in keys)

    def matrix(self, keys: tuple[str, ...], shape: tuple[int, ...]) -> Float64:
        """Return the numbers of a key by any of its spellings.

        Raises:
            CalibrationError: The key is missing, its numbers are too few or not finite, or the matrix is singular.
        """
        key = next((key for key in keys if key in self.rows), None)
        if key is None:
            raise CalibrationError(
                self.path,
                expected=f"the key {' or '.join(keys)}",
                found=f"only {', '.join(self.rows) or 'an empty file'}",
            )
        numbers = self._numbers(key, int(np.prod(shape))).reshape(shape)
        if len(shape) == 2 and abs(np.linalg.det(numbers[:, :3])) < 1e-6:
            raise CalibrationError(
                self.path, expected=f"an invertible {key}", found="a singular matrix"
            )
        return numbers

    def _numbers(self, key: str, count: int) -> Float64:
        try:
            numbers = np.array(self.rows[key].split(), np.float64)
        except ValueError as error:
            raise CalibrationError(
                self.path, expected=f"{count} numbers after {key}", found=f"{self.rows[key]!r}"
            ) from error
        if len(numbers) != count or not np.isfinite(numbers).all():
            raise CalibrationError(
                self.path,
                expected=f"{count} finite numbers after {key}",
                found=f"{int(np.isfinite(numbers).sum())}",
            )
        return numbers


def read_benchmark_calibration(path: Path) -> DriveCalibration:
    """Read the one file of a tracking sequence or an object frame.

    Raises:
        CalibrationError: A key of the camera is missing, or a matrix cannot be used.
    """
    text = CalibrationText.read(path)
    # A camera that is not rectified to another has no such row.
    has_rectification = any(key in text.rows for key in _RECTIFICATION_KEYS)
    rectification = text.matrix(_RECTIFICATION_KEYS, (3, 3)) if has_rectification else np.eye(3)
    camera = Calibration(
        image_P_cam=text.matrix(_PROJECTION_KEYS, (3, 4)),
        cam_SE3_velo=_rectify(rectification, _homogeneous(text.matrix(_VELO_TO_CAM_KEYS, (3, 4)))),
        image_size_px=_image_size_px(text) if text.has((_IMAGE_SIZE_KEY,)) else None,
        source=str(path),
    )
    has_imu = text.has(_IMU_TO_VELO_KEYS)
    imu = _homogeneous(text.matrix(_IMU_TO_VELO_KEYS, (3, 4))) if has_imu else None
    return DriveCalibration(camera, imu)


def read_raw_calibration(folder: Path, camera: str = "02") -> DriveCalibration:
    """Read the calibration files of a raw recording; None for a missing file.

    Args:
        folder: Folder of the files.
        camera: Number of the camera: 02 is the left colour camera, 03 the right one.

    Raises:
        CalibrationError: A file lacks a key, or a matrix cannot be used.
    """
    has_camera = (folder / CAM_TO_CAM).is_file() or (folder / VELO_TO_CAM).is_file()
    has_imu = (folder / IMU_TO_VELO).is_file()
    return DriveCalibration(
        _read_raw_camera(folder, camera) if has_camera else None,
        _read_raw_transform(folder / IMU_TO_VELO) if has_imu else None,
    )


def _read_raw_camera(folder: Path, camera: str) -> Calibration:
    cam0_SE3_velo = _read_raw_transform(folder / VELO_TO_CAM)
    return read_perspective_camera(folder / CAM_TO_CAM, camera, cam0_SE3_velo)


def read_perspective_camera(path: Path, camera: str, cam0_SE3_velo: Float64) -> Calibration:
    """Read the calibration of a rectified camera.

    Args:
        path: Text with S_rect, R_rect and P_rect of each camera.
        camera: Number of the camera, such as 02.
        cam0_SE3_velo: (4, 4) LiDAR to camera 0 before it was rectified.

    Raises:
        CalibrationError: The file lacks a key, or a matrix cannot be used.
    """
    cameras = CalibrationText.read(path)
    return Calibration(
        image_P_cam=cameras.matrix((f"P_rect_{camera}",), (3, 4)),
        cam_SE3_velo=_rectify(cameras.matrix(("R_rect_00",), (3, 3)), cam0_SE3_velo),
        image_size_px=_image_size_px(cameras, f"S_rect_{camera}"),
        source=str(path),
    )


def with_kitti_image_size(camera: Calibration) -> Calibration:
    """Return a camera of KITTI with the size of its images, where its file does not state it."""
    focal_px = round(float(camera.image_P_cam[0, 0]), 4)
    size_px = camera.image_size_px or _KITTI_IMAGE_SIZES_PX.get(focal_px)
    return replace(camera, image_size_px=size_px)


def _image_size_px(text: CalibrationText, key: str = _IMAGE_SIZE_KEY) -> tuple[int, int]:
    width, height = text.matrix((key,), (2,))
    return int(width), int(height)


def _read_raw_transform(path: Path) -> Float64:
    text = CalibrationText.read(path)
    return from_rotation_translation(text.matrix(("R",), (3, 3)), text.matrix(("T",), (3,)))


def _homogeneous(rows: Float64) -> Float64:
    return from_rotation_translation(rows[:, :3], rows[:, 3])


def _rectify(rectification: Float64, cam0_SE3_velo: Float64) -> Float64:
    return from_rotation_translation(rectification, np.zeros(3)) @ cam0_SE3_velo


def format_benchmark_calibration(calibration: DriveCalibration) -> str:
    """Return the text of a tracking or object calibration file, the rectification folded into Tr."""
    rows: dict[str, Float] = {}
    if calibration.camera is not None:
        # Readers of the benchmarks ask for all four cameras; there is one, so all are the same.
        rows |= {f"P{camera}": calibration.camera.image_P_cam for camera in range(4)}
        rows["R0_rect"] = np.eye(3)
        rows["Tr_velo_to_cam"] = calibration.camera.cam_SE3_velo[:3]
        if calibration.camera.image_size_px is not None:
            rows["S_rect_02"] = np.array(calibration.camera.image_size_px, np.float64)
    if calibration.velo_SE3_imu is not None:
        rows["Tr_imu_to_velo"] = calibration.velo_SE3_imu[:3]
    return _format_rows(rows)


def format_raw_calibration(calibration: DriveCalibration) -> dict[str, str]:
    """Return the text of each calibration file of a raw recording, by file name.

    Raises:
        CalibrationError: The camera does not state the size of its images.
    """
    texts: dict[str, str] = {}
    if calibration.camera is not None:
        texts[CAM_TO_CAM] = _format_raw_camera(calibration.camera)
        texts[VELO_TO_CAM] = _format_raw_transform(calibration.camera.cam_SE3_velo)
    if calibration.velo_SE3_imu is not None:
        texts[IMU_TO_VELO] = _format_raw_transform(calibration.velo_SE3_imu)
    return texts


def _format_raw_camera(camera: Calibration) -> str:
    if camera.image_size_px is None:
        raise CalibrationError(camera.source, expected="image_size_px", found="None")
    size = np.array(camera.image_size_px, np.float64)
    rows: dict[str, Float] = {"R_rect_00": np.eye(3)}
    rows |= {"S_rect_02": size, "R_rect_02": np.eye(3), "P_rect_02": camera.image_P_cam}
    return _format_rows(rows)


def _format_raw_transform(dst_SE3_src: Float64) -> str:
    return _format_rows({"R": dst_SE3_src[:3, :3], "T": dst_SE3_src[:3, 3]})


def _format_rows(rows: Mapping[str, Float]) -> str:
    return "".join(
        f"{key}: {' '.join(f'{number:.12e}' for number in values.ravel())}\n"
        for key, values in rows.items()
    )
