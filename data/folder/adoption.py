"""Describe a folder of scans: what can be seen, what the user states, and what is left to be asked."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from data.folder.config import FILE_NAME, CameraConfig, Extrinsics, FolderConfig
from data.folder.description import description_text
from data.folder.observation import FolderObservation
from perception.atomic_file import write_atomically
from perception.errors import UsageError

_QUESTIONS = {
    "height_m": "How many metres is the LiDAR above the road?",
    "axes": "Which ways do x, y and z of the files point, such as right, forward, up?",
    "sensor": "Which model is the LiDAR, or which .json file describes it?",
    "rate_hz": "How many scans a second are there?",
    "intrinsics": "Which are fx, fy, cx, cy of the camera in pixels?",
    "distortion": "Which are its distortion coefficients; none for rectified images?",
    "lidar_to_camera": "Which transform leads from the LiDAR to the camera: 12 numbers of a matrix, x y z qx qy qz qw, "
    "or x y z and roll pitch yaw in degrees?",
    "body_to_lidar": "Which transform leads from the body of the poses (IMU, camera) to the LiDAR, in the same forms; none "
    "where they are of the LiDAR?",
}
_CAMERA = ("intrinsics", "distortion", "lidar_to_camera")
_NUMBERS = (*_CAMERA, "body_to_lidar")
_TEXTS = ("axes", "sensor")


@dataclass(frozen=True)
class StatedConfig:
    """What the user states; None, or nothing, for what is to be seen.

    Attributes:
        sensor: Name of a LiDAR model, or a file.
        height_m: Height of the LiDAR above the road in metres.
        axes: Directions of x, y and z of the files.
        rate_hz: Scans per second.
        reflectance_scale: Value of a reflectance of 1.
        intrinsics: Focal lengths and principal point fx, fy, cx, cy in pixels.
        distortion: Distortion coefficients.
        is_fisheye: Whether they are those of OpenCV's fisheye model.
        lidar_to_camera: Transform as 12 or 16 numbers of a matrix, 7 of translation and quaternion, or 6 of translation and angles.
        body_to_lidar: Transform from the body of the poses to the LiDAR, in the same forms.
    """

    sensor: str | None = None
    height_m: float | None = None
    axes: tuple[str, ...] = ()
    rate_hz: float | None = None
    reflectance_scale: float | None = None
    intrinsics: tuple[float, ...] = ()
    distortion: tuple[float, ...] = ()
    is_fisheye: bool = False
    lidar_to_camera: tuple[float, ...] = ()
    body_to_lidar: tuple[float, ...] = ()


def open_questions(observed: FolderObservation, stated: StatedConfig) -> tuple[str, ...]:
    """Return the fields that can neither be seen nor are stated."""
    guessed = {one.field for one in observed.guesses}
    asked: list[str] = [
        name for name in ("height_m", "axes", "sensor", "rate_hz") if name in guessed
    ]
    if observed.images is not None:
        asked += _CAMERA if not stated.intrinsics else _CAMERA[2:]
    if observed.config.poses is not None:
        asked.append("body_to_lidar")
    return tuple(name for name in asked if not getattr(stated, name))


def ask(
    questions: Sequence[str], stated: StatedConfig, reply_to: Callable[[str], str]
) -> StatedConfig:
    """Ask for what cannot be seen; nothing is stated by an empty reply.

    Args:
        questions: Fields to ask for.
        stated: What the user states already.
        reply_to: Function that puts a question to the user and returns the reply.

    Raises:
        UsageError: A reply is no number.
    """
    for name in questions:
        words = reply_to(f"{_QUESTIONS[name]} (empty: not known) ").replace(",", " ").split()
        if words:
            stated = replace(stated, **{name: _parsed(name, words)})
    return stated


def _parsed(name: str, words: Sequence[str]) -> Any:  # noqa: ANN401 - of the field's type
    if name in _TEXTS:
        return tuple(words) if name == "axes" else " ".join(words)
    try:
        numbers = tuple(map(float, words))
    except ValueError as error:
        raise UsageError(name, expected="numbers", found=" ".join(words)) from error
    return numbers if name in _NUMBERS else numbers[0]


def adopted_config(observed: FolderObservation, stated: StatedConfig) -> FolderConfig:
    """Return what is known of a drive; what is stated comes before what was seen.

    Raises:
        DriveError: A stated value cannot be.
        UsageError: There are too few or too many numbers of a camera.
    """
    lidar = observed.config.lidar
    changes: dict[str, Any] = {
        name: value
        for name in ("height_m", "rate_hz", "reflectance_scale", "axes", "sensor")
        if (value := getattr(stated, name))
    }
    if stated.sensor is not None:
        changes["elevations_deg"] = None
    if stated.axes:  # the tilt is about the axes that were seen
        changes |= {} if stated.axes == lidar.axes else {"roll_deg": 0.0, "pitch_deg": 0.0}
    poses = observed.config.poses
    if poses is not None and stated.body_to_lidar:
        poses = replace(poses, body_to_lidar=_extrinsics(stated.body_to_lidar, "body_to_lidar"))
    camera = _camera(observed, stated)
    return replace(observed.config, lidar=replace(lidar, **changes), camera=camera, poses=poses)


def _camera(observed: FolderObservation, stated: StatedConfig) -> CameraConfig | None:
    if observed.images is None or not (stated.intrinsics and stated.lidar_to_camera):
        return None
    if len(stated.intrinsics) != 4:
        raise UsageError(
            "intrinsics", expected="4 numbers, fx fy cx cy", found=str(len(stated.intrinsics))
        )
    fx_px, fy_px, cx_px, cy_px = stated.intrinsics
    return CameraConfig(
        images=observed.images,
        fx_px=fx_px,
        fy_px=fy_px,
        cx_px=cx_px,
        cy_px=cy_px,
        lidar_to_camera=_extrinsics(stated.lidar_to_camera, "lidar_to_camera"),
        model="fisheye" if stated.is_fisheye else "pinhole",
        distortion=stated.distortion,
    )


def _extrinsics(numbers: tuple[float, ...], name: str) -> Extrinsics:
    if len(numbers) in (12, 16):
        return Extrinsics(matrix=tuple(numbers[row : row + 4] for row in range(0, len(numbers), 4)))
    if len(numbers) == 7:
        return Extrinsics(translation_m=numbers[:3], quaternion_xyzw=numbers[3:])
    if len(numbers) == 6:
        return Extrinsics(translation_m=numbers[:3], roll_pitch_yaw_deg=numbers[3:])
    raise UsageError(name, expected="6, 7, 12 or 16 numbers", found=str(len(numbers)))


def write_description(
    root: Path, observed: FolderObservation, stated: StatedConfig, *, overwrite: bool
) -> tuple[Path, tuple[str, ...]]:
    """Write drive.yaml; return its path, and the fields that are left as questions in it.

    Raises:
        PerceptionError: A stated value cannot be, or the file exists or cannot be written.
    """
    path = root / FILE_NAME
    if path.exists() and not overwrite:
        raise UsageError(
            path, expected="no such file yet", found="one", advice="pass --overwrite to replace it"
        )
    config = adopted_config(observed, stated)
    left = open_questions(observed, stated)
    text = description_text(config, observed, _comments(left))
    write_atomically(path, text.encode())
    return path, left


def _comments(fields: Sequence[str]) -> Mapping[str, str]:
    comments = {name: _QUESTIONS[name] for name in fields if name not in _NUMBERS}
    if set(fields) & set(_CAMERA):
        comments["camera"] = (
            "The calibration of a camera cannot be seen. To use the images, fill in and uncomment:"
        )
    return comments


def other_layout_of(path: Path) -> str | None:
    """Return the name of the layout that a path has already, which needs no drive.yaml; None for a folder of scans."""
    from data.folder.layout import FOLDER, LOOSE_SCANS
    from data.layout_registry import layouts

    layout = next((one for one in layouts() if one.sequences(path) is not None), None)
    return None if layout is None or layout in (FOLDER, LOOSE_SCANS) else layout.name
