"""What drive.yaml may state: the sensors of a folder of scans, and where its parts lie.

Paths are relative to the folder. Directions and transforms of the LiDAR are those of its axes as the files have them.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from data.clouds.cloud import require_column_names
from perception.errors import DriveError
from perception.geometry.se3 import from_rotation_translation
from perception.types import Float64

FILE_NAME = "drive.yaml"
Viewpoint = Literal["ignored", "applied", "undone"]
Direction = Literal["forward", "backward", "left", "right", "up", "down"]
_VECTORS = {
    "forward": (1, 0, 0), "backward": (-1, 0, 0), "left": (0, 1, 0), "right": (0, -1, 0),
    "up": (0, 0, 1), "down": (0, 0, -1),
}  # fmt: skip
_ORTHONORMAL = 1e-3


@dataclass(frozen=True)
class Extrinsics:
    """A rigid transform: by a matrix, or by a rotation in one of two forms and a translation.

    Attributes:
        matrix: (4, 4) or (3, 4) matrix, row by row.
        quaternion_xyzw: Rotation as a quaternion x, y, z, w.
        roll_pitch_yaw_deg: Rotation as Rz(yaw) Ry(pitch) Rx(roll), in degrees.
        translation_m: Origin of the first frame in the second one, in metres.
    """

    matrix: tuple[tuple[float, ...], ...] | None = None
    quaternion_xyzw: tuple[float, ...] | None = None
    roll_pitch_yaw_deg: tuple[float, ...] | None = None
    translation_m: tuple[float, ...] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Validate that there is one rotation, and its numbers."""
        forms = {
            "matrix": self.matrix,
            "quaternion_xyzw": self.quaternion_xyzw,
            "roll_pitch_yaw_deg": self.roll_pitch_yaw_deg,
        }
        given = [name for name, value in forms.items() if value is not None]
        if len(given) != 1:
            expected = f"one of {', '.join(forms)}"
            raise DriveError("extrinsics", expected=expected, found=", ".join(given) or "none")
        lengths = (len(self.quaternion_xyzw or (0,) * 4), len(self.roll_pitch_yaw_deg or (0,) * 3))
        rows = [len(row) for row in self.matrix or ((0,) * 4,) * 4]
        if lengths != (4, 3) or len(self.translation_m) != 3 or rows not in ([4] * 3, [4] * 4):
            raise DriveError(
                "extrinsics",
                expected="3 or 4 rows of 4 numbers, 4 of a quaternion, 3 of angles and of a translation",
                found="other numbers of them",
            )
        rotation = self.dst_SE3_src()[:3, :3]
        if (
            not np.allclose(rotation @ rotation.T, np.eye(3), atol=_ORTHONORMAL)
            or np.linalg.det(rotation) < 0
        ):
            raise DriveError("extrinsics", expected="a rotation", found="a matrix that is none")

    def dst_SE3_src(self) -> Float64:
        """Return the (4, 4) transform from the first frame to the second."""
        if self.matrix is not None:
            return np.vstack([np.array(self.matrix, np.float64)[:3], [[0.0, 0.0, 0.0, 1.0]]])
        if self.quaternion_xyzw is not None:
            if not np.linalg.norm(self.quaternion_xyzw) > 0:
                return np.zeros((4, 4))
            rotation = Rotation.from_quat(self.quaternion_xyzw)
        else:
            yaw_pitch_roll = (self.roll_pitch_yaw_deg or (0.0, 0.0, 0.0))[::-1]
            rotation = Rotation.from_euler("ZYX", yaw_pitch_roll, degrees=True)
        return from_rotation_translation(rotation.as_matrix(), np.array(self.translation_m))


@dataclass(frozen=True)
class LidarConfig:
    """The LiDAR and its files.

    Attributes:
        scans: Folder of the scans, or recording of packets; else the folder with the most of them.
        address: Address and port of the LiDAR, in a recording of several.
        columns: Names of the columns in order, for files without names.
        sensor: Name of a model such as VLP-16, or a file that describes one, of packets the metadata; a name of one's own with
            elevations_deg.
        elevations_deg: Elevations of the beams in degrees, highest first, for a sensor that is no known model.
        azimuth_step_deg: Angle between two firings of one beam in degrees.
        rate_hz: Revolutions per second.
        height_m: Height of the LiDAR above the road in metres.
        axes: Directions in which x, y and z of the files point.
        roll_deg: Roll of the LiDAR against the road in degrees, left side up positive.
        pitch_deg: Pitch of the LiDAR against the road in degrees, front down positive.
        reflectance_scale: Value in the files of a reflectance of 1; larger ones are cut off.
        timestamps: File of a time a scan; else the times in the names of the scans, else a steady rate.
        time_offset_s: Seconds that are added to the times of the scans.
        point_labels: Folder of SemanticKITTI's .label files, one a scan.
        viewpoint: VIEWPOINT of PCD files: ignored, applied to the points, or undone where these are in the world's frame.
    """

    scans: str | None = None
    address: str | None = None
    columns: tuple[str, ...] | None = None
    sensor: str | None = None
    elevations_deg: tuple[float, ...] | None = None
    azimuth_step_deg: float = 0.2
    rate_hz: float | None = None
    height_m: float | None = None
    axes: tuple[Direction, ...] = ("forward", "left", "up")
    roll_deg: float = 0.0
    pitch_deg: float = 0.0
    reflectance_scale: float = 1.0
    timestamps: str | None = None
    time_offset_s: float = 0.0
    point_labels: str | None = None
    viewpoint: Viewpoint | None = None

    def __post_init__(self) -> None:
        """Validate columns, axes, scale and tilt."""
        if self.columns is not None:
            require_column_names(self.columns, "columns")
        turn = np.array([_VECTORS[one] for one in self.axes], np.float64)
        if turn.shape != (3, 3) or not np.isclose(np.linalg.det(turn), 1):
            raise DriveError(
                "axes",
                expected="three directions of a right-handed frame, such as [forward, left, up] or [right, forward, up]",
                found=", ".join(self.axes) or "none",
            )
        for name in ("reflectance_scale", "rate_hz", "height_m", "azimuth_step_deg"):
            value = getattr(self, name)
            if value is not None and not 0 < value < np.inf:
                raise DriveError(name, expected="a positive number", found=f"{value:g}")
        if not max(abs(self.roll_deg), abs(self.pitch_deg)) <= 90:
            found = f"{self.roll_deg:g} and {self.pitch_deg:g}"
            raise DriveError("roll_deg and pitch_deg", expected="at most 90 degrees", found=found)

    def velo_SE3_lidar(self) -> Float64:
        """Return the (4, 4) turn from the axes of the files to x forward, y left, z up on a level road."""
        turn = np.array([_VECTORS[one] for one in self.axes], np.float64).T
        tilt = Rotation.from_euler("ZYX", (0.0, self.pitch_deg, self.roll_deg), degrees=True)
        is_level = self.roll_deg == 0 and self.pitch_deg == 0
        level = np.eye(3) if is_level else tilt.as_matrix()
        return from_rotation_translation(level @ turn, np.zeros(3))


@dataclass(frozen=True)
class CameraConfig:
    """The camera and its files.

    Attributes:
        images: Folder of the images.
        fx_px: Focal length along the columns in pixels.
        fy_px: Focal length along the rows in pixels.
        cx_px: Column of the principal point in pixels.
        cy_px: Row of the principal point in pixels.
        lidar_to_camera: Transform of points from the LiDAR to the camera with x right, y down, z forward.
        model: Distortion model: OpenCV's pinhole (k1 k2 p1 p2 k3 ...) or its fisheye (k1 k2 k3 k4).
        distortion: Distortion coefficients; none for rectified images.
        size_px: Width and height of the images in pixels; else those of the first image.
        timestamps: File of a time an image; else the times in the names of the images.
        time_offset_s: Seconds that are added to the times of the images.
    """

    images: str
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    lidar_to_camera: Extrinsics
    model: Literal["pinhole", "fisheye"] = "pinhole"
    distortion: tuple[float, ...] = ()
    size_px: tuple[int, ...] | None = None
    timestamps: str | None = None
    time_offset_s: float = 0.0

    def __post_init__(self) -> None:
        """Validate focal lengths, the number of coefficients, and the size."""
        if not min(self.fx_px, self.fy_px) > 0:
            raise DriveError(
                "fx_px and fy_px",
                expected="positive numbers",
                found=f"{self.fx_px:g} and {self.fy_px:g}",
            )
        counts = (0, 4) if self.model == "fisheye" else (0, 4, 5, 8, 12, 14)
        if len(self.distortion) not in counts:
            expected = f"{', '.join(map(str, counts))} coefficients of a {self.model} camera"
            raise DriveError("distortion", expected=expected, found=str(len(self.distortion)))
        if self.size_px is not None and (len(self.size_px) != 2 or min(self.size_px) < 1):
            raise DriveError("size_px", expected="width and height", found=str(self.size_px))

    @property
    def camera_matrix(self) -> Float64:
        """(3, 3) intrinsic matrix."""
        return np.array([[self.fx_px, 0, self.cx_px], [0, self.fy_px, self.cy_px], [0, 0, 1.0]])


@dataclass(frozen=True)
class PosesConfig:
    """Poses of a body in the world.

    Attributes:
        file: KITTI's rows of 12 numbers, TUM's of 8, a CSV table of poses, or one of latitudes, longitudes and altitudes.
        format: Format of the file.
        body_to_lidar: Transform of points from the body (IMU, camera) to the LiDAR; else the body is the LiDAR.
    """

    file: str
    format: Literal["kitti", "tum", "csv", "ins"]
    body_to_lidar: Extrinsics | None = None


@dataclass(frozen=True)
class FolderConfig:
    """A folder of scans.

    Attributes:
        lidar: The LiDAR and its files.
        camera: The camera and its files, or None without one.
        cameras: Several cameras by name in place of it, the main one first.
        poses: Poses or INS, or None without them.
        labels: File or folder of labels, in KITTI's rows or in the form of a labelling tool, or None without them.
        classes: Names for classes that the labels call otherwise.
    """

    lidar: LidarConfig = field(default_factory=LidarConfig)
    camera: CameraConfig | None = None
    poses: PosesConfig | None = None
    labels: str | None = None
    cameras: dict[str, CameraConfig] = field(default_factory=dict)
    classes: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Validate that there is one camera or a list of them, and that their names can be listed with commas."""
        if self.camera is not None and self.cameras:
            raise DriveError("cameras", expected="camera or cameras", found="both")
        if odd := [name for name in self.cameras if "," in name or not name.strip()]:
            raise DriveError("cameras", expected="names without commas", found=repr(odd[0]))

    @property
    def named_cameras(self) -> dict[str, CameraConfig]:
        """Cameras by name; of a single one its section."""
        return self.cameras if self.camera is None else {"camera": self.camera}
