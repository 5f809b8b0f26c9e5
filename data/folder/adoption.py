"""Describe a folder of scans: what can be seen, what the user states, and what is left to be asked."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from data.folder.config import FILE_NAME, CameraConfig, FolderConfig, Viewpoint
from data.folder.description import description_text
from data.folder.layout import RECORDING
from data.folder.observation import FolderObservation, observe_folder, observe_recording
from data.folder.open_folder import recording_at
from data.folder.stated_cameras import StatedCamera, camera_names, stated_extrinsics
from data.layouts import OpenConfig
from data.packets.recording import is_beams_file
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
_UNKNOWN = "unknown"
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
        viewpoint: What is done with the VIEWPOINT of PCD files.
        cameras: What is stated of the first cameras.
        body_to_lidar: Transform from the body of the poses to the LiDAR as 12 or 16 numbers of a matrix, 7 of translation and quaternion,
            or 6 of translation and angles.
    """

    sensor: str | None = None
    height_m: float | None = None
    axes: tuple[str, ...] = ()
    rate_hz: float | None = None
    reflectance_scale: float | None = None
    viewpoint: Viewpoint | None = None
    cameras: tuple[StatedCamera, ...] = ()
    body_to_lidar: tuple[float, ...] = ()


@dataclass(frozen=True)
class Question:
    """A value that can neither be seen nor is stated.

    Attributes:
        field: Field of `StatedConfig`, or of `StatedCamera`.
        camera: Number of the camera, or None.
        name: Name for the user, with that of the camera where there are several.
        guess: Value that holds until one is stated.
    """

    field: str
    camera: int | None = None
    name: str = ""
    guess: str = _UNKNOWN

    def __str__(self) -> str:
        guess = "" if self.guess == _UNKNOWN else f" (guess: {self.guess})"
        return f"{self.name or self.field}{guess}"

    @property
    def text(self) -> str:
        """The question as a sentence."""
        of_camera = self.name.removesuffix(self.field).removesuffix(".")
        return f"{of_camera}: {_QUESTIONS[self.field]}" if of_camera else _QUESTIONS[self.field]


def observe(path: Path, config: OpenConfig) -> tuple[Path, FolderObservation]:
    """Return the folder of scans, or the recording of packets at a path, and what can be seen of it.

    Args:
        path: Folder, or recording; of a folder of one recording, that is taken.
        config: Columns of the scans; metadata and address of the LiDAR of a recording.

    Raises:
        PerceptionError: There are no scans, several recordings, or none can be read.
    """
    recordings = RECORDING.sequences(path) or ()
    if len(recordings) > 1:
        found, advice = ", ".join(recordings), "name one of them"
        raise UsageError(path, expected="one recording", found=found, advice=advice)
    path = path / recordings[0] if recordings else path
    recording = recording_at(path, config)
    if recording is not None:
        return recording.path, observe_recording(recording)
    return path, observe_folder(path, config.columns or None)


def open_questions(observed: FolderObservation, stated: StatedConfig) -> tuple[Question, ...]:
    """Return what can neither be seen nor is stated."""
    guessed = {one.field: one.value for one in observed.guesses}
    asked = [name for name in ("height_m", "axes", "sensor", "rate_hz") if name in guessed]
    unstated = (name for name in asked if not getattr(stated, name))
    questions = [Question(name, guess=guessed[name]) for name in unstated]
    names = camera_names(observed.images)
    for number, name in enumerate(names):
        camera = _stated_camera(stated, number)
        fields = _CAMERA if not camera.intrinsics else _CAMERA[2:]
        start = f"{name}." if len(names) > 1 else ""
        questions += [
            Question(field, number, f"{start}{field}")
            for field in fields
            if not getattr(camera, field)
        ]
    if observed.config.poses is not None and not stated.body_to_lidar:
        questions.append(Question("body_to_lidar"))
    return tuple(questions)


def _stated_camera(stated: StatedConfig, number: int) -> StatedCamera:
    return stated.cameras[number] if number < len(stated.cameras) else StatedCamera()


def ask(
    questions: Sequence[Question], stated: StatedConfig, reply_to: Callable[[str], str]
) -> StatedConfig:
    """Ask for what cannot be seen; nothing is stated by an empty reply.

    Args:
        questions: Values to ask for.
        stated: What the user states already.
        reply_to: Function that puts a question to the user and returns the reply.

    Raises:
        UsageError: A reply is no number.
    """
    for question in questions:
        words = reply_to(f"{question.text} (empty: {question.guess}) ").replace(",", " ").split()
        if not words:
            continue
        value = {question.field: _parsed(question.field, words)}
        if question.camera is None:
            stated = replace(stated, **value)
        else:
            count = max(len(stated.cameras), question.camera + 1)
            cameras = [_stated_camera(stated, number) for number in range(count)]
            cameras[question.camera] = replace(cameras[question.camera], **value)
            stated = replace(stated, cameras=tuple(cameras))
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
    if stated.sensor is not None and is_beams_file(Path(stated.sensor)):
        stated = replace(stated, sensor=None)  # it is observed
    changes: dict[str, Any] = {
        name: value
        for name in ("height_m", "rate_hz", "reflectance_scale", "axes", "sensor", "viewpoint")
        if (value := getattr(stated, name)) not in (None, ())
    }
    if stated.sensor is not None:
        changes["elevations_deg"] = None
    if stated.axes:  # the tilt is about the axes that were seen
        changes |= {} if stated.axes == lidar.axes else {"roll_deg": 0.0, "pitch_deg": 0.0}
    poses = observed.config.poses
    if poses is not None and stated.body_to_lidar:
        poses = replace(
            poses, body_to_lidar=stated_extrinsics(stated.body_to_lidar, "body_to_lidar")
        )
    cameras = _cameras(observed, stated)
    is_single = len(observed.images) == 1
    return replace(
        observed.config,
        lidar=replace(lidar, **changes),
        camera=next(iter(cameras.values()), None) if is_single else None,
        cameras={} if is_single else cameras,
        poses=poses,
    )


def _cameras(observed: FolderObservation, stated: StatedConfig) -> dict[str, CameraConfig]:
    """Return the cameras that are known, by name.

    Raises:
        UsageError: More cameras are stated than there are folders of images.
    """
    if len(stated.cameras) > max(len(observed.images), 1):
        raise UsageError(
            "cameras",
            expected=f"numbers of at most {max(len(observed.images), 1)}, as there are folders of images",
            found=f"those of {len(stated.cameras)}",
        )
    names = camera_names(observed.images)
    known = {}
    for number, (name, images) in enumerate(zip(names, observed.images, strict=True)):
        config = _stated_camera(stated, number).config(images)
        if config is not None:
            known[name] = config
    return known


def write_description(
    root: Path, observed: FolderObservation, stated: StatedConfig, *, overwrite: bool
) -> tuple[Path, tuple[Question, ...]]:
    """Write drive.yaml; return its path, and what is left as a question in it.

    Raises:
        PerceptionError: A stated value cannot be, or the file exists or cannot be written.
    """
    path = (root.parent if root.is_file() else root) / FILE_NAME
    if path.exists() and not overwrite:
        raise UsageError(
            path, expected="no such file yet", found="one", advice="pass --overwrite to replace it"
        )
    config = adopted_config(observed, stated)
    left = open_questions(observed, stated)
    text = description_text(config, observed, _comments(left))
    write_atomically(path, text.encode())
    return path, left


def _comments(questions: Sequence[Question]) -> Mapping[str, str]:
    comments = {one.field: one.text for one in questions if one.field not in _NUMBERS}
    if any(one.camera is not None for one in questions):
        comments["camera"] = (
            "The calibration of a camera cannot be seen. To use the images, fill in and uncomment:"
        )
    return comments


def other_layout_of(path: Path) -> str | None:
    """Return the name of the layout that a path has already, which needs no drive.yaml; None for a folder of scans."""
    from data.folder.layout import FOLDER, LOOSE_SCANS
    from data.layout_registry import layouts

    layout = next((one for one in layouts() if one.sequences(path) is not None), None)
    return None if layout is None or layout in (FOLDER, LOOSE_SCANS, RECORDING) else layout.name
