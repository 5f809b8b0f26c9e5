"""A drive of KITTI-360, as it is downloaded: a folder for each kind of data, in each a folder or file for each drive.

data_3d_raw/DRIVE/velodyne_points/data/0000000000.bin   velodyne_points/timestamps.txt
data_2d_raw/DRIVE/image_00/data_rect/0000000000.png     image_00/timestamps.txt
data_poses/DRIVE/poses.txt  cam0_to_world.txt           data_3d_bboxes/train/DRIVE.xml
calibration/calib_cam_to_velo.txt  calib_cam_to_pose.txt  perspective.txt
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from data.derived.motion_labels import PosedLabels
from data.kitti.drive import KittiDrive, find_reflectance_scale
from data.kitti.image_joining import join_images
from data.kitti.sensor_files import (
    IMAGE_SUFFIXES,
    FrameFiles,
    describe_folder,
    list_folder,
    scans_in,
)
from data.kitti.sequence import CameraFiles, ScanClock
from data.kitti.timestamps import file_times
from data.kitti360.bounding_boxes import DriveBoxes
from data.kitti360.calibration import RigCalibration, missing_files
from data.kitti360.poses import POSES, FrameClock, ScanPoses, StatedPoses
from data.labelled_objects import labels_of_boxes
from data.labels_in_view import labels_of_camera
from data.layouts import Layout, OpenConfig
from perception.errors import DriveError, UsageError
from perception.geometry.boxes import transform_boxes
from perception.geometry.se3 import inverse
from perception.types import Float64, Labels

_PARTS = ("data_3d_raw", "data_2d_raw", "data_poses", "data_3d_bboxes")
_SCANS, _IMAGES, _POSES, _BOXES = _PARTS
_SCAN_FOLDER, _TIMESTAMPS = Path("velodyne_points/data"), "timestamps.txt"
_CAMERAS, _FISHEYES = ("image_00", "image_01"), ("image_02", "image_03")


@dataclass(frozen=True, kw_only=True)
class Kitti360Drive(KittiDrive):
    """Scans of one drive.

    Attributes:
        clock: Times of the scans.
        poses: Poses of the scans, or None.
        boxes: Annotated boxes, or None.
    """

    clock: ScanClock
    poses: ScanPoses | None
    boxes: DriveBoxes | None

    @property
    def has_poses(self) -> bool:
        """Whether frames carry poses."""
        return self.poses is not None

    @property
    def has_labels(self) -> bool:
        """Whether there are labelled boxes, which poses place around the LiDAR."""
        return self.boxes is not None

    @property
    def origin_ns(self) -> int:
        """Time at which stamps are 0."""
        return self.clock.origin_ns

    def stamp_s(self, index: int) -> float:
        """Return the time of a scan since the drive's first."""
        return self.clock.stamp_s(index)

    def world_SE3_velo(self, index: int) -> Float64 | None:
        """Return the (4, 4) pose of one frame, or None where registration alone tells it."""
        return None if self.poses is None else self.poses.world_SE3_velo[index]

    def _texts(self, index: int) -> tuple[Path, ...]:
        return () if self.boxes is None else (self.boxes.path,)

    def labels(self, index: int) -> Labels:
        """Return the labels of the objects in the view of the camera; all of it is DontCare in a frame without labels."""
        return labels_of_camera(self.labels_around(index), self, index)

    def labels_around(self, index: int) -> Labels | None:
        """Return the labels of all objects around; None where no pose is near, or nothing was annotated."""
        if self.boxes is None or self.poses is None:
            return super().labels(index)
        frame, pose = self.scans.numbers[index], self.poses.world_SE3_velo[index]
        is_annotated = self.poses.has_near[index] and self.boxes.is_annotated(frame)
        if pose is None or not is_annotated:
            return None
        file_SE3_velo = self.poses.in_file(pose)
        known = self.boxes.at(frame).near(file_SE3_velo[:3, 3], self.sensor.max_range_m)
        boxes_velo = transform_boxes(inverse(file_SE3_velo), known.boxes_world)
        return labels_of_boxes(boxes_velo, known.types.tolist(), known.track_ids)

    def other_labels(self) -> list[PosedLabels]:
        """Return none: boxes of moments without a scan have no time."""
        return []


@dataclass(frozen=True)
class DriveFolders:
    """Where the parts of a drive lie.

    Attributes:
        root: Folder of all drives.
        scans: Folder of the drive's scans.
    """

    root: Path
    scans: Path

    @classmethod
    def at(cls, path: Path, name: str | None) -> "DriveFolders":
        """Find the parts of a drive, by the folder of all drives, of all scans, or of the drive's scans."""
        if name is None:
            return cls(path.absolute().parents[1], path)
        if path.absolute().name == _SCANS:
            return cls(path.absolute().parent, path / name)
        return cls(path, path / _SCANS / name)

    @property
    def name(self) -> str:
        """Name of the drive."""
        return self.scans.absolute().name

    @property
    def calibration(self) -> Path:
        """Folder of the calibration of all drives."""
        return self.root / "calibration"

    @property
    def images(self) -> Path:
        """Folder with a folder for each camera."""
        return self.root / _IMAGES / self.name

    @property
    def poses(self) -> Path:
        """Folder of the poses."""
        return self.root / _POSES / self.name

    @property
    def boxes(self) -> Path | None:
        """File of the boxes, the one with all of them first; None without one."""
        files = (self.root / _BOXES / part / f"{self.name}.xml" for part in ("train_full", "train"))
        return next((file for file in files if file.is_file()), None)


def open_kitti360(path: Path, name: str | None, config: OpenConfig) -> Kitti360Drive:
    """Open a drive; its scans and images are read frame by frame, its boxes when they are asked for.

    Raises:
        DriveError: There is no scan.
        UsageError: There is no such camera.
        PerceptionError: The calibration or the poses cannot be read.
    """
    folders = DriveFolders.at(path, name)
    scans, sensor = scans_in(folders.scans / _SCAN_FOLDER), config.lidar_model(folders.scans)
    timestamps = folders.scans / _SCAN_FOLDER.parent / _TIMESTAMPS
    clock = ScanClock.of(timestamps, scans, sensor.rate_hz)
    name = _choose_camera(folders, config)
    rig = RigCalibration.read(folders.calibration, name)
    images = FrameFiles.within(folders.images / name / "data_rect", IMAGE_SUFFIXES)
    image_times = file_times(folders.images / name / _TIMESTAMPS, images)
    joined = join_images(scans, images, file_times(timestamps, scans), image_times)
    camera = CameraFiles.of(rig.camera, images, joined, load=config.images)
    frame_clock = FrameClock(np.array(scans.numbers), clock.stamps_s, sensor.rate_hz)
    poses = _read_poses(folders, rig, frame_clock)
    boxes, reflectance = folders.boxes, find_reflectance_scale(scans, config)
    return Kitti360Drive(
        name=folders.name,
        root=folders.scans,
        sensor=sensor,
        calibration=camera.calibration,
        scans=scans,
        clock=clock,
        images=camera.images,
        poses=poses,
        boxes=None if poses is None or boxes is None else DriveBoxes(boxes),
        reflectance_scale=reflectance.scale,
        notes=(*joined.notes, *_notes(folders, rig, poses), *reflectance.notes),
    )


def _choose_camera(folders: DriveFolders, config: OpenConfig) -> str:
    """Return the name of the camera that is asked for, else of the first that has images."""
    if config.camera in _FISHEYES:
        raise UsageError(
            f"--camera {config.camera}",
            expected=f"a camera whose images are rectified, {' or '.join(_CAMERAS)}",
            found="a fisheye camera",
        )
    if config.camera is None:
        return next((name for name in _CAMERAS if (folders.images / name).is_dir()), _CAMERAS[0])
    return config.camera_among(_CAMERAS)


def _read_poses(folders: DriveFolders, rig: RigCalibration, clock: FrameClock) -> ScanPoses | None:
    """Return the poses of the scans; None without poses, or without the calibration that they need."""
    bodies = (rig.imu_SE3_velo, None if rig.camera is None else rig.camera.cam_SE3_velo)
    for name, body_SE3_velo in zip(POSES, bodies, strict=True):
        if body_SE3_velo is not None and (folders.poses / name).is_file():
            stated = StatedPoses.read(folders.poses / name)
            return ScanPoses.of(stated, body_SE3_velo, clock)
    return None


def _notes(folders: DriveFolders, rig: RigCalibration, poses: ScanPoses | None) -> Iterator[str]:
    """Yield a sentence for each part that is not used, or not as it is."""
    fisheyes = [name for name in _FISHEYES if (folders.images / name).is_dir()]
    if fisheyes:
        yield (
            f"{folders.images}: {' and '.join(fisheyes)} are left out, as detectors and maps take images of a pinhole "
            "camera, not of a fisheye lens"
        )
    missing = " and ".join(missing_files(folders.calibration))
    has_images = any((folders.images / name / "data_rect").is_dir() for name in _CAMERAS)
    if has_images and rig.camera is None:
        yield f"{folders.images}: images cannot be joined to points without {missing} in {folders.calibration}"
    has_poses = any((folders.poses / name).is_file() for name in POSES)
    if has_poses and poses is None:
        yield f"{folders.poses}: poses are not used without {missing} in {folders.calibration}"
    if not has_poses and (folders.poses / "oxts").is_dir():
        yield f"{folders.poses}: INS packets are not used, as they are in another world than the boxes"
    if poses is not None and poses.note:
        yield poses.note
    if folders.boxes and poses is None:
        yield f"{folders.boxes}: boxes are not used without poses, which place them around the LiDAR"


def drives_at(path: Path) -> tuple[str, ...] | None:
    """Return the names of the drives; none where the path is one itself, None where there is none.

    Raises:
        DriveError: Other parts of the set are there, but no scans.
    """
    if path.absolute().parent.name == _SCANS:
        return () if (path / _SCAN_FOLDER).is_dir() else None
    is_scans = path.absolute().name == _SCANS
    parts = [name for name in _PARTS if (path / name).is_dir()]
    if not (parts or is_scans):
        return None
    folder = path if is_scans else path / _SCANS
    drives = (one.name for one in list_folder(folder) if (one / _SCAN_FOLDER).is_dir())
    if names := tuple(sorted(drives)):
        return names
    raise DriveError(
        path,
        expected=f"scans of KITTI-360 in {_SCANS}/DRIVE/{_SCAN_FOLDER}",
        found=f"only {', '.join(parts)}" if parts else describe_folder(path),
        advice="download the Velodyne scans of the drive, too",
    )


KITTI_360 = Layout(
    "KITTI-360",
    f"KITTI-360 ({_SCANS} beside {_POSES}) or a drive in its {_SCANS}",
    drives_at,
    open_kitti360,
)
