"""A frame: scan, images and pose at one time, and the calibration of each camera."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from perception.errors import CalibrationError, ImageError, PoseError, ScanError, UsageError
from perception.types.table import Float32, Float64, UInt8, require_shape

_MAX_COORDINATE_M = 10_000.0  # far beyond any LiDAR; larger numbers overflow where they are squared
_MAX_POINT_TIME_S = 1.0  # sweeps take 0.05 to 0.2 s; larger numbers are of another unit or origin
_KINDS = {"points_velo": np.float32, "world_SE3_velo": np.float64, "point_times_s": np.float32}
_MAX_INVALID_SHARE = 0.5  # with more, the file is of another format rather than a scan with gaps


@dataclass(frozen=True)
class Calibration:
    """A rectified pinhole camera, and the pose of the LiDAR in its frame.

    Attributes:
        image_P_cam: (3, 4) projection of the rectified reference camera's frame to pixels; KITTI's P2.
        cam_SE3_velo: (4, 4) LiDAR to rectified reference camera; KITTI's R0_rect * Tr_velo_to_cam.
        image_size_px: (width, height) where the calibration states it.
        source: File of the calibration, for error messages.
    """

    image_P_cam: Float64
    cam_SE3_velo: Float64
    image_size_px: tuple[int, int] | None = None
    source: str = "calibration"

    def __post_init__(self) -> None:
        """Validate shapes, and that the matrices are invertible."""
        require_shape(f"{self.source} image_P_cam", self.image_P_cam, (3, 4))
        require_shape(f"{self.source} cam_SE3_velo", self.cam_SE3_velo, (4, 4))
        for name, square in (
            ("image_P_cam", self.image_P_cam[:, :3]),
            ("cam_SE3_velo", self.cam_SE3_velo),
        ):
            if not np.isfinite(square).all() or abs(np.linalg.det(square)) < 1e-9:
                raise CalibrationError(
                    self.source, expected=f"an invertible {name}", found="a singular matrix"
                )

    @property
    def image_P_velo(self) -> Float64:
        """(3, 4) projection from the LiDAR frame to pixels (3.1)."""
        return self.image_P_cam @ self.cam_SE3_velo


@dataclass(frozen=True)
class CameraImage:
    """Image of a further camera beside a scan.

    Attributes:
        name: Name of the camera.
        calibration: Calibration of the camera.
        image: (H, W, 3) RGB, or None where the camera has none at this time.
    """

    name: str
    calibration: Calibration
    image: UInt8 | None = None


@dataclass(frozen=True)
class Frame:
    """Scan, images and pose at one time.

    A scan keeps the number and order of its points, so that labels of points fit to its file. A point that is no
    measurement (NaN, infinity or beyond 10 km, usual in organised clouds) becomes a point without a return, which has
    x = y = z = reflectance = 0; no stage uses it, and its state is `PointState.OUTSIDE`. Arrays of other types are
    converted once, here.

    Attributes:
        index: Position of the frame within its drive, from 0.
        stamp_s: Time of the scan in seconds.
        points_velo: (N, 4) x, y, z in metres and reflectance 0..1.
        image: (H, W, 3) RGB of the main camera, or None without one.
        world_SE3_velo: (4, 4) INS pose of the LiDAR in a frame fixed to the earth, or None without INS.
        calibration: Calibration of the main camera, or None without one.
        source: File of the scan, for error messages.
        name: Name of the frame's result files; else its number in six digits.
        number: Frame number in KITTI's rows; else the index.
        invalid_points: Number of points that were no measurement.
        point_times_s: (N,) times of the points in seconds from `stamp_s`, or None where they are not known.
        camera: Name of the main camera.
        further_cameras: Images of the other cameras, the same cameras in the same order in every frame of a drive.
    """

    index: int
    stamp_s: float
    points_velo: Float32
    image: UInt8 | None = None
    world_SE3_velo: Float64 | None = None
    calibration: Calibration | None = None
    source: str = "frame"
    name: str = ""
    number: int = -1
    invalid_points: int = 0
    point_times_s: Float32 | None = None
    camera: str = "camera"
    further_cameras: tuple[CameraImage, ...] = ()

    @property
    def views(self) -> "tuple[Frame, ...]":
        """The frame as each camera sees it: itself, then the same scan with the image of each further camera."""
        # Kept in the frame, a tuple with the frame itself would hold it until cyclic garbage is collected.
        return (self, *self._further_views)

    @cached_property
    def _further_views(self) -> "tuple[Frame, ...]":
        return tuple(
            replace(
                self,
                camera=one.name,
                image=one.image,
                calibration=one.calibration,
                further_cameras=(),
            )
            for one in self.further_cameras
        )

    def __post_init__(self) -> None:
        """Validate the scan, the pose, the names of the cameras, and the size of the image."""
        if self.number < 0:
            object.__setattr__(self, "number", self.index)
        if not self.name:
            object.__setattr__(self, "name", f"{self.number:06d}")
        self._convert_arrays()
        require_shape(f"{self.source} points_velo", self.points_velo, ("N", 4))
        self._zero_invalid_points()
        self._check_scan()
        if self.point_times_s is not None:
            self._check_point_times(self.point_times_s)
        if self.world_SE3_velo is not None:
            require_shape(f"{self.source} world_SE3_velo", self.world_SE3_velo, (4, 4))
            if not np.isfinite(self.world_SE3_velo).all():
                raise PoseError(self.source, expected="a finite pose", found="NaN or infinity")
        if self.image is not None:
            self._check_image(self.image)
        names = [self.camera, *(one.name for one in self.further_cameras)]
        if len(set(names)) < len(names):
            raise UsageError("cameras", expected="each camera once", found=", ".join(names))

    def _convert_arrays(self) -> None:
        """Give arrays the one type and order of memory that all stages, and their compiled functions, are for."""
        for name, kind in _KINDS.items():
            values = getattr(self, name)
            if values is not None:
                with np.errstate(over="ignore"):  # infinite from here on, and no measurement
                    converted = np.asarray(values, kind, order="C")
                object.__setattr__(self, name, converted)

    def _zero_invalid_points(self) -> None:
        points = self.points_velo
        # The two comparisons are false with NaN.
        if len(points) == 0 or (
            points.max() < _MAX_COORDINATE_M and points.min() > -_MAX_COORDINATE_M
        ):
            return
        x, y, z, reflectance = (np.abs(points) < _MAX_COORDINATE_M).T
        is_invalid = ~(x & y & z & reflectance)
        invalid = int(is_invalid.sum())
        if invalid > _MAX_INVALID_SHARE * len(points):
            raise ScanError(
                self.source,
                expected="x, y, z in metres and reflectance, finite for at least half of the points",
                found=f"{invalid} of {len(points)} points with NaN, infinity or above 10,000",
                advice="write x, y, z, reflectance as float32, or give its full scale: --reflectance-scale 65535",
            )
        valid_points = points.copy()
        valid_points[is_invalid] = 0
        object.__setattr__(self, "points_velo", valid_points)
        object.__setattr__(self, "invalid_points", self.invalid_points + invalid)

    def _check_scan(self) -> None:
        xyz_m = self.points_velo[:, :3]
        if not (xyz_m[:1].any() or xyz_m.any()):  # the first point is a return of most scans
            count = len(xyz_m)
            found = f"{count} points, all of them zero" if count else "an empty scan"
            raise ScanError(self.source, expected="at least one return", found=found)
        low, high = self.points_velo[:, 3].min(), self.points_velo[:, 3].max()
        if low < 0 or high > 1:
            raise ScanError(
                self.source,
                expected="reflectance from 0 to 1",
                found=f"{low:g} to {high:g}",
                advice="give its full scale: --reflectance-scale 255 for most sensors",
            )

    def _check_point_times(self, times_s: Float32) -> None:
        require_shape(f"{self.source} point_times_s", times_s, (len(self.points_velo),))
        if not (np.abs(times_s) < _MAX_POINT_TIME_S).all():  # false with NaN
            raise ScanError(
                self.source,
                expected=f"point times within {_MAX_POINT_TIME_S:g} s of the scan's",
                found=f"{times_s.min():g} to {times_s.max():g} s",
                advice="give them in seconds from the time of the scan",
            )

    def _check_image(self, image: UInt8) -> None:
        require_shape(f"{self.source} image", image, ("H", "W", 3))
        size = self.calibration.image_size_px if self.calibration else None
        height, width = image.shape[:2]
        if size is not None and size != (width, height):
            raise ImageError(
                self.source,
                expected=f"an image of {size[0]}x{size[1]} pixels as its calibration says",
                found=f"{width}x{height}",
            )
