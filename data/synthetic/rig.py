"""Mounting of camera, LiDAR and INS on the synthetic vehicle, similar to KITTI's."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from data.kitti.calibration import DriveCalibration
from data.synthetic.raycasting import Rays, near_any
from data.synthetic.words import CameraName
from perception.geometry import camera, se3
from perception.types import Calibration, Float64, Int

IMAGE_SIZE_PX = (1242, 375)
_FOCAL_PX, _CENTRE_PX = 721.5377, (609.5, 172.9)
_BASELINE_M = 0.06  # from the rectified reference camera to the colour camera
# Axes of the LiDAR (x forward, y left, z up) seen along those of a camera (x right, y down, z forward).
_CAMERA_AXES = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


# Each sees 81 degrees: front, left, right and rear leave 9 degrees between them, neighbours at 55 degrees overlap by 26.
_YAWS_DEG: Mapping[CameraName, float] = {
    "front": 0.0, "front_left": 55.0, "front_right": -55.0, "left": 90.0, "right": -90.0, "rear": 180.0,
}  # fmt: skip


def default_calibration() -> DriveCalibration:
    """Return the rig's calibration, with mounting angles of a fraction of a degree."""
    image_P_cam = np.array(
        [
            [_FOCAL_PX, 0.0, _CENTRE_PX[0], _FOCAL_PX * _BASELINE_M],
            [0.0, _FOCAL_PX, _CENTRE_PX[1], 0.2],
            [0.0, 0.0, 1.0, 0.003],
        ]
    )
    tilt = se3.from_euler(np.radians(0.3), np.radians(0.5), np.radians(-0.4))
    axes = se3.from_rotation_translation(_CAMERA_AXES, np.array([0.0, -0.08, -0.27]))
    velo_SE3_imu = se3.from_euler(
        np.radians(-0.2), np.radians(0.3), np.radians(0.4), np.array([-0.8, 0.3, -0.8])
    )
    return DriveCalibration(
        Calibration(image_P_cam, axes @ tilt, IMAGE_SIZE_PX, source="synthetic camera"),
        velo_SE3_imu,
    )


def camera_calibration(name: CameraName) -> Calibration:
    """Return the calibration of one of the vehicle's cameras: the front camera, turned around the LiDAR's axis."""
    front = default_calibration().camera
    assert front is not None
    if name == "front":
        return front
    turn = se3.from_euler(0.0, 0.0, np.radians(_YAWS_DEG[name]))
    source = f"synthetic camera {name}"
    return replace(front, cam_SE3_velo=front.cam_SE3_velo @ se3.inverse(turn), source=source)


class PinholeCamera:
    """The colour camera at one moment: pixels to rays and back."""

    def __init__(self, calibration: Calibration, world_SE3_velo: Float64) -> None:
        """Place the camera by the pose of the LiDAR."""
        self.size_px = calibration.image_size_px or IMAGE_SIZE_PX
        self.image_P_world = calibration.image_P_velo @ se3.inverse(world_SE3_velo)
        self._back = np.linalg.inv(self.image_P_world[:, :3])
        self.centre_m = -self._back @ self.image_P_world[:, 3]
        self.camera_R_world = (calibration.cam_SE3_velo @ se3.inverse(world_SE3_velo))[:3, :3]
        self.focal_px = float(calibration.image_P_cam[0, 0])
        self.middle_px = calibration.image_P_cam[:2, 2]
        # The bands of an image ask for the same spheres.
        self._windows: dict[tuple[float, ...], tuple[slice, slice]] = {}

    def project(self, points_world: Float64) -> tuple[Float64, Float64]:
        """Return (N, 2) pixels, NaN behind the camera, and (N,) depths."""
        return camera.project(self.image_P_world, points_world)

    def rays(self, pixels: Float64, near: Callable[[Float64, float], Int] | None = None) -> Rays:
        """Return the rays through (N, 2) pixels; `near` finds those that may meet a sphere."""
        homogeneous = np.column_stack([pixels, np.ones(len(pixels))])
        directions = homogeneous @ self._back.T
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        directions = np.ascontiguousarray(directions, np.float32)
        origins = np.broadcast_to(self.centre_m.astype(np.float32), directions.shape).copy()
        delays = np.zeros(len(pixels), np.float32)
        return Rays(origins, directions, delays, near or near_any(origins, directions))

    def window_px(self, centre_m: Float64, radius_m: float) -> tuple[slice, slice]:
        """Return the rows and columns that may show a sphere."""
        sphere = (*centre_m.tolist(), radius_m)
        if sphere not in self._windows:
            x, y, z = (self.camera_R_world @ (centre_m - self.centre_m)).tolist()
            (column, row), (width, height) = self.middle_px.tolist(), self.size_px
            self._windows[sphere] = (
                _span(y, z, radius_m, self.focal_px, row, height),
                _span(x, z, radius_m, self.focal_px, column, width),
            )
        return self._windows[sphere]


def near_pixels(pinhole: PinholeCamera, band: slice) -> Callable[[Float64, float], Int]:
    """Return a search for the pixels of a band of rows that may see a sphere."""
    width = pinhole.size_px[0]
    row_start = np.arange(band.stop - band.start)[:, None] * width
    empty = np.zeros(0, np.int64)

    def near(centre_m: Float64, radius_m: float) -> Int:
        rows, columns = pinhole.window_px(centre_m, radius_m)
        first, last = max(rows.start, band.start), min(rows.stop, band.stop)
        if first >= last or columns.start >= columns.stop:
            return empty
        inside = row_start[first - band.start : last - band.start]
        return np.asarray((inside + np.arange(columns.start, columns.stop)).ravel())

    return near


def _span(
    across_m: float,
    ahead_m: float,
    radius_m: float,
    focal_px: float,
    middle_px: float,
    size_px: int,
) -> slice:
    """Return the pixels along one axis that a circle before the camera covers."""
    distance = float(np.hypot(across_m, ahead_m))
    if distance <= radius_m:
        return slice(0, size_px)
    middle, half = np.arctan2(across_m, ahead_m), np.arcsin(radius_m / distance)
    if middle - half > 1.5 or middle + half < -1.5:
        return slice(0, 0)
    edges = middle_px + focal_px * np.tan(np.clip([middle - half, middle + half], -1.55, 1.55))
    low, high = np.clip([edges[0] - 1, edges[1] + 2], 0, size_px).astype(int)
    return slice(low, high)
