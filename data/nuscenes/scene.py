"""A scene of nuScenes as a drive: every scan of its LiDAR, key frames and sweeps between them."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from data.derived.motion_labels import PosedLabels
from data.drive_images import ImageFiles
from data.kitti.sensor_files import list_folder
from data.labelled_objects import box_owners
from data.labels_in_view import labels_of_camera
from data.layouts import Layout, OpenConfig
from data.nearest_time import NONE, nearest_in_time
from data.nuscenes.boxes import SceneBoxes
from data.nuscenes.json_tables import read_records
from data.nuscenes.scans import ego_SE3_velo, read_point_classes, read_points
from data.nuscenes.scene_tables import DEFAULT_CAMERA, LIDAR, SceneTables, SensorData
from data.per_frame import FrameTuple
from data.recorded_drive import RecordedDrive
from perception.errors import CalibrationError, DriveError
from perception.geometry.se3 import inverse
from perception.sensor import HDL_32E, load_sensor
from perception.types import Bool, Calibration, Float32, Float64, Labels, PointTruth

_SCENES = "scene.json"
_RATE_HZ = 20.0  # of the LiDAR
_MAX_IMAGE_GAP_S = 0.05  # the camera takes 12 images a second
_MIN_SPEED_M_S = 0.5  # of a moving box, as in the labels of scene flow
_MOVABLE = (
    10,
    11,
    13,
    15,
    16,
    18,
    20,
    30,
    31,
    32,
)  # SemanticKITTI's classes of vehicles and people


@dataclass(frozen=True, kw_only=True)
class NuScenesScene(RecordedDrive):
    """Scans of one scene.

    Attributes:
        scans: Scans in order of time.
        numbers: Place of each scan in the scene.
        ego_SE3_velo: (4, 4) place of the LiDAR on the vehicle.
        boxes: Annotated boxes.
    """

    scans: FrameTuple[SensorData]
    numbers: FrameTuple[int]
    ego_SE3_velo: Float64
    boxes: SceneBoxes

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Name of each frame in results: the time of its scan in microseconds."""
        return tuple(str(scan.stamp_us) for scan in self.scans)

    @property
    def frame_numbers(self) -> tuple[int, ...]:
        """Number of each frame in KITTI's rows: its place in the scene."""
        return self.numbers

    @property
    def has_poses(self) -> bool:
        """Whether frames carry poses: yes."""
        return True

    @property
    def has_labels(self) -> bool:
        """Whether there are labelled boxes."""
        return not self.boxes.is_empty

    @property
    def has_point_truth(self) -> bool:
        """Whether the class of every point of a key frame is known."""
        return bool(self.boxes.tables.point_labels)

    def source(self, index: int) -> str:
        """Return the file of a scan."""
        return str(self.scans[index].path)

    def frame_files(self, index: int) -> tuple[Path, ...]:
        """Return the files of a frame and its labels."""
        image = None if self.images is None else self.images.file(index)
        labels = self.boxes.tables.folder / "sample_annotation.json"
        return tuple(path for path in (self.scans[index].path, labels, image) if path is not None)

    def points_velo(self, index: int) -> Float32:
        """Read (N, 4) points with x forward and y left."""
        return read_points(self.scans[index].path)

    @property
    def origin_ns(self) -> int:
        """Time of the scene's first scan."""
        return 1000 * self.boxes.tables.data[LIDAR][0].stamp_us

    def stamp_s(self, index: int) -> float:
        """Return the time of a scan since the scene's first."""
        return (self.scans[index].stamp_us - self.boxes.tables.data[LIDAR][0].stamp_us) / 1e6

    def world_SE3_velo(self, index: int) -> Float64:
        """Return the (4, 4) pose of the LiDAR."""
        pose = self.map_SE3_velo(index)
        # From the first scan on, so that positions keep their precision.
        pose[:3, 3] -= self.boxes.tables.data[LIDAR][0].world_SE3_ego[:3, 3]
        return pose

    def map_SE3_velo(self, index: int) -> Float64:
        """Return the (4, 4) pose of the LiDAR in the world of the tables."""
        return np.asarray(self.scans[index].world_SE3_ego @ self.ego_SE3_velo)

    def sample_token(self, index: int) -> str | None:
        """Return the name of the sample of a key frame; None of a sweep."""
        scan = self.scans[index]
        return scan.sample if scan.is_key_frame else None

    def labels(self, index: int) -> Labels:
        """Return the labels of the objects in the view of the camera."""
        return labels_of_camera(self.labels_around(index), self, index)

    def labels_around(self, index: int) -> Labels:
        """Return the labels of all objects around; between key frames on the way from one to the next."""
        if self.boxes.is_empty:
            return super().labels(index)
        return self.boxes.around(self._label_stamp_us(index), self.map_SE3_velo(index))

    def other_labels(self) -> list[PosedLabels]:
        """Return none: the key frames are among the frames."""
        return []

    def _label_stamp_us(self, index: int) -> int:
        """Return the time of a scan; that of its sample in a key frame."""
        scan = self.scans[index]
        return self.boxes.tables.stamps_us[scan.sample] if scan.is_key_frame else scan.stamp_us

    def point_truth(self, index: int) -> PointTruth | None:
        """Return the truth of the points of a key frame, or None between key frames.

        Points move where the box around them does; those of vehicles and people without a box have no label.
        """
        path = self.boxes.tables.point_labels.get(self.scans[index].token)
        if path is None:
            return None
        points_velo = self.points_velo(index)
        classes = read_point_classes(path, len(points_velo), self.boxes.tables.point_categories)
        labels = self.labels_around(index)
        owners = box_owners(labels.boxes_velo, points_velo)
        ids, moves = np.append(labels.track_ids, -1), np.append(self._moves(index, labels), False)
        classes[np.isin(classes, _MOVABLE) & (owners < 0)] = 0
        return PointTruth(
            classes,
            np.asarray(np.where(np.isin(classes, _MOVABLE), ids[owners] + 1, 0)),
            np.asarray(np.isin(classes, _MOVABLE) & moves[owners]),
        )

    def _moves(self, index: int, labels: Labels) -> Bool:
        """Return (M,) which objects travel until the next key frame, or have since the one before."""
        stamp_us, pose = self._label_stamp_us(index), self.map_SE3_velo(index)
        stamps_us = list(self.boxes.tables.stamps_us.values())
        place = stamps_us.index(stamp_us)
        neighbours_us = [*stamps_us[place + 1 : place + 2], *stamps_us[max(place - 1, 0) : place]]
        speeds_m_s: dict[int, float] = {}
        for other_us in neighbours_us:
            others = self.boxes.around(other_us, pose)
            for row, track in enumerate(labels.track_ids.tolist()):
                there_m = others.boxes_velo.bottom_m[others.track_ids == track]
                if len(there_m) and track not in speeds_m_s:
                    step_m = np.linalg.norm(there_m[0] - labels.boxes_velo.bottom_m[row])
                    speeds_m_s[track] = float(step_m) * 1e6 / abs(other_us - stamp_us)
        speeds = [speeds_m_s.get(track, 0.0) for track in labels.track_ids.tolist()]
        return np.array(speeds, np.float64) >= _MIN_SPEED_M_S


def open_scene(path: Path, name: str | None, config: OpenConfig) -> NuScenesScene:
    """Open a scene; its scans are read frame by frame.

    Raises:
        DriveError: A table is missing or damaged, or the scene has no scan.
        CalibrationError: A sensor has no calibration.
    """
    folder = next(one for one in _table_folders(path) if name in _scenes_in(one))
    assert name is not None
    camera = config.camera or DEFAULT_CAMERA
    tables = SceneTables.read(folder, name, camera)
    scans = tables.data[LIDAR]
    if not scans:
        raise DriveError(folder / "sample_data.json", expected=f"scans of {name}", found="none")
    place = tables.places[LIDAR].ego_SE3_sensor
    velo = ego_SE3_velo(place)
    sensor = replace(
        HDL_32E,
        rate_hz=_RATE_HZ,
        azimuth_step_rad=2 * HDL_32E.azimuth_step_rad,
        height_m=float(place[2, 3]),
    )
    return NuScenesScene(
        name=name,
        root=folder.parent,
        # sensor.json is a table of the set.
        sensor=sensor if config.sensor is None else load_sensor(config.sensor),
        calibration=_calibration(tables, camera, velo),
        scans=FrameTuple(scans),
        numbers=FrameTuple(range(len(scans))),
        images=_images(tables, camera) if config.images else None,
        ego_SE3_velo=velo,
        boxes=SceneBoxes(tables),
        notes=_notes(tables),
    )


def _notes(tables: SceneTables) -> tuple[str, ...]:
    boxes = [one for ones in tables.annotations.values() for one in ones]
    unknown = sum(not one.category for one in boxes)
    if not unknown:
        return ()
    sentence = "boxes have no category, and are of no class that is measured"
    return (
        f"{tables.folder}: {unknown} of {len(boxes)} {sentence}; instance.json and category.json tell it",
    )


def _calibration(tables: SceneTables, camera: str, velo: Float64) -> Calibration | None:
    place = tables.places.get(camera)
    if place is None:
        return None
    source = f"{tables.folder / 'calibrated_sensor.json'} {camera}"
    if place.camera_matrix is None:
        raise CalibrationError(source, expected="an intrinsic matrix", found="none")
    image_P_cam = np.hstack([place.camera_matrix, np.zeros((3, 1))])
    return Calibration(
        image_P_cam, inverse(place.ego_SE3_sensor) @ velo, tables.image_size_px(camera), source
    )


def _images(tables: SceneTables, camera: str) -> ImageFiles | None:
    """Return the image that is nearest to each scan, or None where no scan has one."""
    images = [one for one in tables.data[camera] if one.path.is_file()]
    first_us = tables.data[LIDAR][0].stamp_us
    scans_s, images_s = (
        np.array([one.stamp_us - first_us for one in data], np.float64) / 1e6
        for data in (tables.data[LIDAR], images)
    )
    nearest = nearest_in_time(scans_s, images_s, _MAX_IMAGE_GAP_S)
    if (nearest == NONE).all():
        return None
    return ImageFiles(tuple(None if row == NONE else images[row].path for row in nearest.tolist()))


def _table_folders(path: Path) -> list[Path]:
    """Return the folders of tables at a path: itself, or v1.0-mini and the like within it."""
    if (path / _SCENES).is_file():
        return [path]
    return sorted(one for one in list_folder(path) if (one / _SCENES).is_file())


def _scenes_in(folder: Path) -> list[str]:
    return [str(one["name"]) for one in read_records(folder / _SCENES, ("name",))]


def scenes_of_samples(path: Path) -> dict[str, str]:
    """Return the name of the scene of each sample of the tables at a path; none where there are no tables."""
    found: dict[str, str] = {}
    for folder in _table_folders(path):
        scenes = read_records(folder / _SCENES, ("token", "name"))
        names = {one["token"]: str(one["name"]) for one in scenes}
        samples = read_records(folder / "sample.json", ("token", "scene_token"))
        found |= {
            one["token"]: names[one["scene_token"]]
            for one in samples
            if one["scene_token"] in names
        }
    return found


def scenes_at(path: Path) -> tuple[str, ...] | None:
    """Return the names of the scenes, or None where no tables of nuScenes lie beside samples."""
    folders = [one for one in _table_folders(path) if (one.parent / "samples").is_dir()]
    return tuple(sorted(name for folder in folders for name in _scenes_in(folder))) or None


NUSCENES = Layout("nuScenes", "nuScenes (v1.0-*/scene.json beside samples)", scenes_at, open_scene)
