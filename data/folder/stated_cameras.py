"""What the user states of the cameras of a folder, which cannot be seen in their images."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

from data.folder.config import CameraConfig, Extrinsics
from perception.errors import UsageError

_PLAIN_NAMES = ("data", "images")  # of a folder below that of the camera


@dataclass(frozen=True)
class StatedCamera:
    """What the user states of one camera; nothing for what is not known.

    Attributes:
        intrinsics: Focal lengths and principal point fx, fy, cx, cy in pixels.
        distortion: Distortion coefficients.
        is_fisheye: Whether they are those of OpenCV's fisheye model.
        lidar_to_camera: Transform as 12 or 16 numbers of a matrix, 7 of translation and quaternion, or 6 of translation and angles.
    """

    intrinsics: tuple[float, ...] = ()
    distortion: tuple[float, ...] = ()
    is_fisheye: bool = False
    lidar_to_camera: tuple[float, ...] = ()

    def config(self, images: str) -> CameraConfig | None:
        """Return the camera of a folder of images; None where intrinsics or transform are not known.

        Raises:
            UsageError: There are too few or too many numbers.
        """
        if not (self.intrinsics and self.lidar_to_camera):
            return None
        if len(self.intrinsics) != 4:
            raise UsageError(
                "intrinsics",
                expected="4 numbers of each camera, fx fy cx cy",
                found=str(len(self.intrinsics)),
            )
        fx_px, fy_px, cx_px, cy_px = self.intrinsics
        return CameraConfig(
            images=images,
            fx_px=fx_px,
            fy_px=fy_px,
            cx_px=cx_px,
            cy_px=cy_px,
            lidar_to_camera=stated_extrinsics(self.lidar_to_camera, "lidar_to_camera"),
            model="fisheye" if self.is_fisheye else "pinhole",
            distortion=self.distortion,
        )


def split_cameras(
    intrinsics: tuple[float, ...],
    distortion: tuple[float, ...],
    lidar_to_camera: tuple[float, ...],
    *,
    is_fisheye: bool,
) -> tuple[StatedCamera, ...]:
    """Return the first cameras of a folder, whose numbers stand one camera after another.

    Args:
        intrinsics: Four numbers of each camera.
        distortion: Distortion coefficients, as many of each camera.
        lidar_to_camera: Transforms, all in one form.
        is_fisheye: Whether the coefficients are those of OpenCV's fisheye model.

    Raises:
        UsageError: The numbers are not as many of each camera.
    """
    count = max(len(intrinsics) // 4, 1)
    for name, numbers in (
        ("intrinsics", intrinsics),
        ("distortion", distortion),
        ("lidar_to_camera", lidar_to_camera),
    ):
        if len(numbers) % count:
            raise UsageError(
                name,
                expected=f"as many numbers of each of the {count} cameras of --intrinsics",
                found=str(len(numbers)),
            )
    return tuple(
        StatedCamera(
            _part(intrinsics, number, count),
            _part(distortion, number, count),
            is_fisheye,
            _part(lidar_to_camera, number, count),
        )
        for number in range(count)
    )


def _part(numbers: tuple[float, ...], number: int, count: int) -> tuple[float, ...]:
    length = len(numbers) // count
    return numbers[number * length : (number + 1) * length]


def stated_extrinsics(numbers: tuple[float, ...], name: str) -> Extrinsics:
    """Return the transform of 12 or 16 numbers of a matrix, 7 of translation and quaternion, or 6 with angles.

    Raises:
        UsageError: There are others.
    """
    if len(numbers) in (12, 16):
        return Extrinsics(matrix=tuple(numbers[row : row + 4] for row in range(0, len(numbers), 4)))
    if len(numbers) == 7:
        return Extrinsics(translation_m=numbers[:3], quaternion_xyzw=numbers[3:])
    if len(numbers) == 6:
        return Extrinsics(translation_m=numbers[:3], roll_pitch_yaw_deg=numbers[3:])
    raise UsageError(name, expected="6, 7, 12 or 16 numbers", found=str(len(numbers)))


def camera_names(folders: Sequence[str]) -> tuple[str, ...]:
    """Return the name of the camera of each folder of images: that of the folder, or its path where two are alike.

    Of `image_02/data` it is `image_02`.
    """
    names = [_name(PurePosixPath(folder)) for folder in folders]
    return tuple(
        name if names.count(name) == 1 else folder.replace("/", "_")
        for folder, name in zip(folders, names, strict=True)
    )


def _name(folder: PurePosixPath) -> str:
    return next((part for part in reversed(folder.parts) if part not in _PLAIN_NAMES), folder.name)
