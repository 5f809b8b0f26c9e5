"""A log of the Argoverse 2 sensor dataset as a drive."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np

from data.argoverse2.annotations import Annotations
from data.argoverse2.calibration import AXLE_HEIGHT_M, DEFAULT_CAMERA, Sensors
from data.argoverse2.ground_map import GroundMap
from data.argoverse2.point_truth import FLOW_FILE, FLOW_FOLDER, TruthSources
from data.argoverse2.sweeps import measure_sensor, read_sweep
from data.argoverse2.trajectory import Trajectory
from data.derived.motion_labels import PosedLabels
from data.kitti.sensor_files import list_folder, read_image
from data.labels_in_view import labels_in_view
from data.layouts import Layout, OpenConfig
from data.nearest_time import NONE, nearest_in_time
from data.recorded_drive import RecordedDrive
from perception.errors import DriveError, UsageError
from perception.sensor import LidarModel, load_sensor
from perception.types import Calibration, Float32, Float64, Labels, PointTruth, UInt8

_SWEEPS, _CAMERAS = Path("sensors/lidar"), Path("sensors/cameras")
_ANNOTATIONS, _POSES, _CALIBRATION = (
    "annotations.feather", "city_SE3_egovehicle.feather", "calibration",
)  # fmt: skip
_MAX_IMAGE_GAP_NS = 50_000_000  # half a turn of the LiDAR


@dataclass(frozen=True, kw_only=True)
class Argoverse2Log(RecordedDrive):
    """Sweeps of one log, all of the same two LiDARs.

    Attributes:
        sweeps: Sweep of each frame by its time in nanoseconds.
        images: Image of each sweep, None where none is near in time; None without a camera.
        ego_SE3_velo: (4, 4) place of the LiDAR on the vehicle.
        trajectory: Poses of the vehicle.
        annotations: Boxes, or None.
        truth: Truth of points.
    """

    sweeps: tuple[tuple[int, Path], ...]
    images: tuple[Path | None, ...] | None
    ego_SE3_velo: Float64
    trajectory: Trajectory
    annotations: Annotations | None
    truth: TruthSources

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Name of each frame in results: the time of its sweep."""
        return tuple(path.stem for _, path in self.sweeps)

    @cached_property
    def frame_numbers(self) -> tuple[int, ...]:
        """Number of each frame in KITTI's rows: its place in the log."""
        return tuple(self._numbers[stamp] for stamp, _ in self.sweeps)

    @cached_property
    def _numbers(self) -> dict[int, int]:
        return {stamp: number for number, (stamp, _) in enumerate(_sweeps_in(self.root))}

    @property
    def is_sequence(self) -> bool:
        """Whether frames follow each other in time: yes."""
        return True

    @property
    def has_forward_camera(self) -> bool:
        """Whether the camera is known to face forward: any camera may be chosen."""
        return False

    @property
    def has_images(self) -> bool:
        """Whether frames carry images."""
        return self.images is not None

    @property
    def has_poses(self) -> bool:
        """Whether frames carry poses: yes."""
        return True

    @property
    def has_labels(self) -> bool:
        """Whether there are labelled boxes."""
        return self.annotations is not None

    @property
    def has_point_truth(self) -> bool:
        """Whether the class of every point is known."""
        return not self.truth.is_empty

    def select(self, indices: Sequence[int]) -> Self:
        """Return a drive of some frames alone, which keep their numbers and names."""
        images = None if self.images is None else tuple(self.images[index] for index in indices)
        return replace(self, sweeps=tuple(self.sweeps[index] for index in indices), images=images)

    def source(self, index: int) -> str:
        """Return the file of a sweep."""
        return str(self.sweeps[index][1])

    def frame_files(self, index: int) -> tuple[Path, ...]:
        """Return the files of a frame and its labels."""
        image = None if self.images is None else self.images[index]
        files = (self.sweeps[index][1], self.root / _ANNOTATIONS, image)
        return tuple(path for path in files if path is not None)

    def points_velo(self, index: int) -> Float32:
        """Read (N, 4) points at the place of the upper LiDAR, moved to the time of the sweep."""
        return read_sweep(self.sweeps[index][1], self.ego_SE3_velo).points_velo

    def image(self, index: int) -> UInt8 | None:
        """Read the image that is nearest in time."""
        path = None if self.images is None else self.images[index]
        return None if path is None else read_image(path)

    def frame_calibration(self, index: int, image: UInt8 | None = None) -> Calibration | None:
        """Return the calibration of the log."""
        return self.calibration

    def stamp_s(self, index: int) -> float:
        """Return the time of a sweep since the log's first pose."""
        return (self.sweeps[index][0] - self.trajectory.first_ns) / 1e9

    def world_SE3_velo(self, index: int) -> Float64:
        """Return the (4, 4) pose of the LiDAR."""
        return self.trajectory.world_SE3_ego(self.sweeps[index][0]) @ self.ego_SE3_velo

    def labels(self, index: int) -> Labels:
        """Return the labels of the objects in the view of the camera."""
        around = self.labels_around(index)
        return around if self.calibration is None else labels_in_view(around, self.calibration)

    def labels_around(self, index: int) -> Labels:
        """Return the labels of all objects around."""
        if self.annotations is None:
            raise DriveError(self.root, expected=f"a log with {_ANNOTATIONS}", found="none")
        return self.annotations.at(self.sweeps[index][0], self.ego_SE3_velo)

    def other_labels(self) -> list[PosedLabels]:
        """Return the labels of the moments that have no sweep here, numbered down from -1."""
        if self.annotations is None:
            return []
        known = {stamp for stamp, _ in self.sweeps}
        others = [
            stamp
            for stamp in self.annotations.moments_ns
            if stamp not in known and stamp in self.trajectory.city_SE3_ego
        ]
        return [
            PosedLabels(
                -1 - number,
                (stamp - self.trajectory.first_ns) / 1e9,
                self.trajectory.world_SE3_ego(stamp) @ self.ego_SE3_velo,
                self.annotations.at(stamp, self.ego_SE3_velo),
            )
            for number, stamp in enumerate(others)
        ]

    def point_truth(self, index: int) -> PointTruth | None:
        """Return the truth of the points of a sweep, or None where the log has none of it."""
        return self.truth.of(self.sweeps[index][0], self.points_velo(index))


def open_log(folder: Path, name: str | None, config: OpenConfig) -> Argoverse2Log:
    """Open a log, or one of a folder of logs; its sweeps are read frame by frame.

    Raises:
        DriveError: The log holds no sweep.
        UsageError: The sweeps are to be deskewed, or there is no such camera.
        PerceptionError: The calibration, the poses, the boxes or the map cannot be read.
    """
    if config.deskew:
        raise UsageError(
            "--deskew",
            expected="sweeps whose points are not moved to one time",
            found="those of Argoverse 2, which are",
            advice="leave it out",
        )
    root = folder / name if name else folder
    sweeps = _sweeps_in(root)
    sensors = Sensors.read(root / _CALIBRATION)
    trajectory = Trajectory.read(root / _POSES)
    has_boxes = (root / _ANNOTATIONS).is_file()
    annotations = Annotations.read(root / _ANNOTATIONS) if has_boxes else None
    camera = config.camera or DEFAULT_CAMERA
    images = _images_in(root / _CAMERAS / camera, sweeps) if config.images else None
    ground = GroundMap.read(root / "map")
    return Argoverse2Log(
        name=root.resolve().name,
        root=root,
        sensor=_sensor(sweeps[0][1], sensors.ego_SE3_velo, config),
        calibration=sensors.camera(camera),
        sweeps=tuple(sweeps),
        images=images,
        ego_SE3_velo=sensors.ego_SE3_velo,
        trajectory=trajectory,
        annotations=annotations,
        truth=TruthSources(
            _flow_files(root, sweeps), annotations, trajectory, ground, sensors.ego_SE3_velo
        ),
        notes=tuple(_notes(root / _CAMERAS / camera, images)) if config.images else (),
    )


def _sensor(first: Path, ego_SE3_velo: Float64, config: OpenConfig) -> LidarModel:
    """Return the model that is asked for, else the beams of the first sweep at the height of the upper LiDAR."""
    if config.sensor is not None:
        return load_sensor(config.sensor)
    height_m = float(ego_SE3_velo[2, 3]) + AXLE_HEIGHT_M
    return measure_sensor(read_sweep(first, ego_SE3_velo), height_m)


def _sweeps_in(root: Path) -> list[tuple[int, Path]]:
    """Return the sweeps of a log in order of time.

    Raises:
        DriveError: There is none, or a name is no time.
    """
    stamped = _by_time(root / _SWEEPS, ".feather")
    if not stamped:
        raise DriveError(
            root / _SWEEPS,
            expected="sweeps named by nanoseconds, such as 315966265259836000.feather",
            found="none",
        )
    return stamped


def _by_time(folder: Path, suffix: str) -> list[tuple[int, Path]]:
    return sorted(
        (int(path.stem), path)
        for path in list_folder(folder)
        if path.suffix == suffix and path.stem.isdecimal()
    )


def _images_in(folder: Path, sweeps: Sequence[tuple[int, Path]]) -> tuple[Path | None, ...] | None:
    """Return the image that is nearest to each sweep, or None where no sweep has one."""
    images = _by_time(folder, ".jpg") + _by_time(folder, ".png")
    first_ns = sweeps[0][0]
    nearest = nearest_in_time(
        _seconds([stamp for stamp, _ in sweeps], first_ns),
        _seconds([stamp for stamp, _ in images], first_ns),
        _MAX_IMAGE_GAP_NS / 1e9,
    )
    if (nearest == NONE).all():
        return None
    return tuple(None if row == NONE else images[row][1] for row in nearest.tolist())


def _seconds(stamps_ns: Sequence[int], first_ns: int) -> Float64:
    return np.array([stamp - first_ns for stamp in stamps_ns], np.float64) / 1e9


def _flow_files(root: Path, sweeps: Sequence[tuple[int, Path]]) -> dict[int, Path]:
    """Return the labels of scene flow by the time of their sweep: one file a sweep, or one of the first alone."""
    files = dict(_by_time(root / FLOW_FOLDER, ".feather"))
    if (root / FLOW_FILE).is_file():
        files.setdefault(sweeps[0][0], root / FLOW_FILE)
    return files


def _notes(folder: Path, images: tuple[Path | None, ...] | None) -> list[str]:
    if images is None:
        return [f"{folder}: no image is near a sweep in time"] if folder.is_dir() else []
    missing = sum(path is None for path in images)
    return (
        [f"{folder}: {missing} of {len(images)} sweeps have no image within 50 ms"]
        if missing
        else []
    )


def is_log(folder: Path) -> bool:
    """Return whether a folder is a log."""
    return (folder / _SWEEPS).is_dir()


def logs_at(path: Path) -> tuple[str, ...] | None:
    """Return the names of the logs in a folder; none where it is a log itself, None where it holds no log."""
    if is_log(path):
        return ()
    return tuple(sorted(entry.name for entry in list_folder(path) if is_log(entry))) or None


ARGOVERSE_2 = Layout(
    "Argoverse 2",
    "an Argoverse 2 sensor log (sensors/lidar) or a folder of such logs",
    logs_at,
    open_log,
)
