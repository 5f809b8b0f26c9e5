"""A log of the Argoverse 2 sensor dataset as a drive."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from data.argoverse2.annotations import Annotations
from data.argoverse2.calibration import AXLE_HEIGHT_M, DEFAULT_CAMERA, Sensors
from data.argoverse2.ground_map import GroundMap
from data.argoverse2.point_truth import FLOW_FILE, FLOW_FOLDER, TruthSources
from data.argoverse2.sweeps import measure_sensor, read_sweep
from data.argoverse2.trajectory import Trajectory
from data.derived.motion_labels import PosedLabels
from data.drive_images import ImageFiles
from data.file_drive import FileDrive
from data.kitti.sensor_files import FrameFiles, list_folder
from data.labels_in_view import labels_of_camera
from data.layouts import Layout, OpenConfig
from data.nearest_time import NONE, nearest_in_time
from perception.errors import DriveError, UsageError
from perception.sensor import LidarModel, load_sensor
from perception.types import Float32, Float64, Labels, PointTruth

_SWEEPS, _CAMERAS = Path("sensors/lidar"), Path("sensors/cameras")
_ANNOTATIONS, _POSES, _CALIBRATION = (
    "annotations.feather", "city_SE3_egovehicle.feather", "calibration",
)  # fmt: skip
_MAX_IMAGE_GAP_NS = 50_000_000  # half a turn of the LiDAR


@dataclass(frozen=True, kw_only=True)
class Argoverse2Log(FileDrive):
    """Sweeps of one log, all of the same two LiDARs.

    A sweep is named by its time in nanoseconds.

    Attributes:
        ego_SE3_velo: (4, 4) place of the LiDAR on the vehicle.
        trajectory: Poses of the vehicle.
        annotations: Boxes, or None.
        truth: Truth of points.
    """

    ego_SE3_velo: Float64
    trajectory: Trajectory
    annotations: Annotations | None
    truth: TruthSources

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

    def _stamp_ns(self, index: int) -> int:
        return int(self.scans.paths[index].stem)

    def _texts(self, index: int) -> tuple[Path | None, ...]:
        return (self.root / _ANNOTATIONS,)

    def points_velo(self, index: int) -> Float32:
        """Read (N, 4) points at the place of the upper LiDAR, moved to the time of the sweep."""
        return read_sweep(self.scans.paths[index], self.ego_SE3_velo).points_velo

    @property
    def origin_ns(self) -> int:
        """Time of the log's first pose by the vehicle's clock, whose zero is not that of Unix."""
        return self.trajectory.first_ns

    def stamp_s(self, index: int) -> float:
        """Return the time of a sweep since the log's first pose."""
        return (self._stamp_ns(index) - self.origin_ns) / 1e9

    def world_SE3_velo(self, index: int) -> Float64:
        """Return the (4, 4) pose of the LiDAR."""
        return self.trajectory.world_SE3_ego(self._stamp_ns(index)) @ self.ego_SE3_velo

    def labels(self, index: int) -> Labels:
        """Return the labels of the objects in the view of the camera."""
        return labels_of_camera(self.labels_around(index), self, index)

    def labels_around(self, index: int) -> Labels:
        """Return the labels of all objects around."""
        if self.annotations is None:
            raise DriveError(self.root, expected=f"a log with {_ANNOTATIONS}", found="none")
        return self.annotations.at(self._stamp_ns(index), self.ego_SE3_velo)

    def task_classes(self, index: int, labels: Labels) -> NDArray[np.str_]:
        """Return the classes of the objects around in nuScenes' detection task."""
        if self.annotations is None:
            return super().task_classes(index, labels)
        return self.annotations.task_classes(self._stamp_ns(index))

    def other_labels(self) -> list[PosedLabels]:
        """Return the labels of the moments that have no sweep here, numbered down from -1."""
        if self.annotations is None:
            return []
        known = set(map(self._stamp_ns, range(len(self))))
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
        return self.truth.of(self._stamp_ns(index), self.points_velo(index))


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
        sensor=_sensor(sweeps.paths[0], sensors.ego_SE3_velo, config),
        calibration=sensors.camera(camera),
        scans=sweeps,
        images=images,
        ego_SE3_velo=sensors.ego_SE3_velo,
        trajectory=trajectory,
        annotations=annotations,
        truth=TruthSources(
            _flow_files(root, sweeps.paths[0]),
            annotations,
            trajectory,
            ground,
            sensors.ego_SE3_velo,
        ),
        notes=tuple(_notes(root / _CAMERAS / camera, images)) if config.images else (),
    )


def _sensor(first: Path, ego_SE3_velo: Float64, config: OpenConfig) -> LidarModel:
    """Return the model that is asked for, else the beams of the first sweep at the height of the upper LiDAR."""
    if config.sensor is not None:
        return load_sensor(config.sensor)
    height_m = float(ego_SE3_velo[2, 3]) + AXLE_HEIGHT_M
    return measure_sensor(read_sweep(first, ego_SE3_velo), height_m)


def _sweeps_in(root: Path) -> FrameFiles:
    """Return the sweeps of a log in order of time.

    Raises:
        DriveError: There is none, or a name is no time.
    """
    folder = root / _SWEEPS
    stamped = _by_time(folder, ".feather")
    if not stamped:
        raise DriveError(
            folder,
            expected="sweeps named by nanoseconds, such as 315966265259836000.feather",
            found="none",
        )
    return FrameFiles(folder, tuple(path for _, path in stamped))


def _by_time(folder: Path, suffix: str) -> list[tuple[int, Path]]:
    return sorted(
        (int(path.stem), path)
        for path in list_folder(folder)
        if path.suffix == suffix and path.stem.isdecimal()
    )


def _images_in(folder: Path, sweeps: FrameFiles) -> ImageFiles | None:
    """Return the image that is nearest to each sweep, or None where no sweep has one."""
    images = _by_time(folder, ".jpg") + _by_time(folder, ".png")
    stamps_ns = [int(path.stem) for path in sweeps.paths]
    nearest = nearest_in_time(
        _seconds(stamps_ns, stamps_ns[0]),
        _seconds([stamp for stamp, _ in images], stamps_ns[0]),
        _MAX_IMAGE_GAP_NS / 1e9,
    )
    if (nearest == NONE).all():
        return None
    return ImageFiles(tuple(None if row == NONE else images[row][1] for row in nearest.tolist()))


def _seconds(stamps_ns: Sequence[int], first_ns: int) -> Float64:
    return np.array([stamp - first_ns for stamp in stamps_ns], np.float64) / 1e9


def _flow_files(root: Path, first: Path) -> dict[int, Path]:
    """Return the labels of scene flow by the time of their sweep: one file a sweep, or one of the first alone."""
    files = dict(_by_time(root / FLOW_FOLDER, ".feather"))
    if (root / FLOW_FILE).is_file():
        files.setdefault(int(first.stem), root / FLOW_FILE)
    return files


def _notes(folder: Path, images: ImageFiles | None) -> list[str]:
    if images is None:
        return [f"{folder}: no image is near a sweep in time"] if folder.is_dir() else []
    missing = images.paths.count(None)
    return (
        [f"{folder}: {missing} of {len(images.paths)} sweeps have no image within 50 ms"]
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
