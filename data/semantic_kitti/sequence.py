"""A sequence of SemanticKITTI or of KITTI's odometry benchmark as a drive.

dataset/sequences/08/velodyne/000000.bin   labels/000000.label   image_2/000000.png
dataset/sequences/08/calib.txt  times.txt  poses.txt (or dataset/poses/08.txt)

The poses are those of the rectified camera, in the frame of its first; in the LiDAR's frame they become the world's.
Classes of points are SemanticKITTI's own, of which those from 252 to 259 move. Its official map of classes for learning
leaves out 0 (unlabelled) and 1 (outlier); its benchmark of moving objects calls 252 to 259 moving and all others static.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from data.derived.instance_boxes import InstanceLabels, labelled_by_instances
from data.kitti.calibration import CalibrationText, with_kitti_image_size
from data.kitti.drive import KittiDrive, find_reflectance_scale
from data.kitti.image_joining import join_images
from data.kitti.reading import read_number_rows
from data.kitti.sensor_files import (
    IMAGE_SUFFIXES,
    POINT_LABEL_SUFFIXES,
    SCAN_SUFFIXES,
    FrameFiles,
    join_notes,
    list_folder,
    scans_in,
)
from data.kitti.sequence import CameraFiles, ScanClock
from data.layouts import Layout, OpenConfig
from perception.errors import DriveError, LabelError, PoseError
from perception.geometry.se3 import from_rotation_translation
from perception.types import Calibration, Float64, PointTruth

# All classes that semantic-kitti.yaml names; those that move are read as the same class and a motion.
_CLASSES = (
    0, 1, 10, 11, 13, 15, 16, 18, 20, 30, 31, 32, 40, 44, 48, 49, 50, 51, 52, 60, 70, 71, 72, 80, 81, 99,
)  # fmt: skip
_POSES, _TIMES, _CALIBRATION = "poses.txt", "times.txt", "calib.txt"
_CAMERA_KEYS, _VELO_TO_CAM_KEYS = ("P2",), ("Tr", "Tr_velo_to_cam")


@dataclass(frozen=True, kw_only=True)
class SemanticKittiSequence(KittiDrive):
    """Frames of one sequence.

    Attributes:
        clock: Times of the scans.
        poses: (P, 4, 4) world_SE3_velo by frame number, or None.
    """

    clock: ScanClock
    poses: Float64 | None

    @property
    def has_poses(self) -> bool:
        """Whether frames carry poses."""
        return self.poses is not None

    def stamp_s(self, index: int) -> float:
        """Return the time of a scan since the sequence's first."""
        return self.clock.stamp_s(index)

    def world_SE3_velo(self, index: int) -> Float64 | None:
        """Return the (4, 4) pose of one frame."""
        if self.poses is None:
            return None
        number = self.scans.numbers[index]
        if number >= len(self.poses):
            raise PoseError(
                self.root / _POSES,
                expected=f"a row for frame {number}",
                found=f"{len(self.poses)} rows",
            )
        return np.asarray(self.poses[number])

    def point_truth(self, index: int) -> PointTruth | None:
        """Read the truth of every point; objects are numbered within their class, and get numbers of their own.

        Raises:
            LabelError: The file is missing, its length differs from that of the scan, or a class is not known.
        """
        truth = super().point_truth(index)
        if truth is None or self.point_labels is None:
            return None
        unknown = np.setdiff1d(truth.classes, _CLASSES)
        if len(unknown):
            raise LabelError(
                self.point_labels.paths[index],
                expected="classes of SemanticKITTI, such as 40 for road and 252 for a moving car",
                found=", ".join(map(str, unknown[:3])),
            )
        own = np.where(truth.instances > 0, truth.instances << 8 | truth.classes, 0)
        return replace(truth, instances=own)


@dataclass(frozen=True, kw_only=True)
class LabelledSequence(InstanceLabels, SemanticKittiSequence):
    """Frames of a sequence whose objects are numbered."""


def open_semantic_kitti(path: Path, name: str | None, config: OpenConfig) -> SemanticKittiSequence:
    """Open a sequence; its files are read frame by frame.

    Raises:
        DriveError: The sequence has no scan, or its times are no numbers.
        CalibrationError: The calibration cannot be used.
        PoseError: The poses cannot be read.
    """
    root = path if name is None else _sequence_folders(path)[name]
    sensor = config.lidar_model(root)
    scans = scans_in(root / "velodyne")
    calibration = _read_calibration(root / _CALIBRATION)
    image_files = FrameFiles.within(root / config.camera_among(("image_2",)), IMAGE_SUFFIXES)
    joined = join_images(scans, image_files, scans.unix_times, image_files.unix_times)
    camera = CameraFiles.of(calibration, image_files, joined, load=config.images)
    reflectance = find_reflectance_scale(scans, config)
    point_labels = FrameFiles.within(root / "labels", POINT_LABEL_SUFFIXES)
    sequence = SemanticKittiSequence(
        name=root.resolve().name,
        root=root,
        sensor=sensor,
        calibration=camera.calibration,
        scans=scans,
        clock=_read_clock(root / _TIMES, scans, sensor.rate_hz),
        poses=_read_poses(_poses_file(root), calibration),
        images=camera.images,
        point_labels=point_labels.joined(scans),
        reflectance_scale=reflectance.scale,
        notes=(
            *joined.notes,
            *join_notes(scans, {"labels of points": point_labels}),
            *reflectance.notes,
        ),
    )
    return labelled_by_instances(sequence, LabelledSequence, config.progress)


def _read_calibration(path: Path) -> Calibration | None:
    if not path.is_file():
        return None
    text = CalibrationText.read(path)
    image_P_cam = text.matrix(_CAMERA_KEYS, (3, 4))
    cam_velo = text.matrix(_VELO_TO_CAM_KEYS, (3, 4))
    cam_SE3_velo = from_rotation_translation(cam_velo[:, :3], cam_velo[:, 3])
    return with_kitti_image_size(Calibration(image_P_cam, cam_SE3_velo, source=str(path)))


def _poses_file(root: Path) -> Path:
    """Return the poses in the sequence's folder, else those of KITTI's odometry benchmark beside all sequences."""
    own, of_benchmark = (
        root / _POSES,
        root.resolve().parents[1] / "poses" / f"{root.resolve().name}.txt",
    )
    return of_benchmark if of_benchmark.is_file() and not own.is_file() else own


def _read_poses(path: Path, calibration: Calibration | None) -> Float64 | None:
    """Return (P, 4, 4) poses of the LiDAR; None without poses, or without the calibration that they need."""
    if not path.is_file() or calibration is None:
        return None
    numbers = read_number_rows(path, 12, PoseError)
    poses = np.tile(np.eye(4), (len(numbers), 1, 1))
    poses[:, :3] = numbers.reshape(-1, 3, 4)
    # A true inverse: the rotations of the files are orthonormal to their printed digits only.
    velo_SE3_cam = np.linalg.inv(calibration.cam_SE3_velo)
    return np.asarray(velo_SE3_cam @ poses @ calibration.cam_SE3_velo)


def _read_clock(path: Path, scans: FrameFiles, rate_hz: float) -> ScanClock:
    if not path.is_file():
        return ScanClock.without_timestamps(scans, rate_hz)
    stamps_s = read_number_rows(path, 1, DriveError)[:, 0]
    known = [stamps_s[row] if row < len(stamps_s) else np.nan for row in scans.numbers]
    return ScanClock(np.array(known), scans.numbers, path)


def is_sequence_folder(folder: Path) -> bool:
    """Return whether a folder is a sequence: scans beside texts of the whole sequence."""
    has_texts = any((folder / name).is_file() for name in (_CALIBRATION, _POSES, _TIMES))
    scans = list_folder(folder / "velodyne") if has_texts else []
    return any(path.suffix in SCAN_SUFFIXES for path in scans)


def _sequence_folders(path: Path) -> dict[str, Path]:
    """Return the sequences in the folder of the set, by name."""
    for parent in (path / "sequences", path / "dataset" / "sequences", path):
        if found := {one.name: one for one in list_folder(parent) if is_sequence_folder(one)}:
            return dict(sorted(found.items()))
    return {}


def sequences_at(path: Path) -> tuple[str, ...] | None:
    """Return the names of the sequences; none where the path is one itself, None where there is none."""
    return () if is_sequence_folder(path) else tuple(_sequence_folders(path)) or None


SEMANTIC_KITTI = Layout(
    "SemanticKITTI",
    "a sequence of SemanticKITTI or KITTI odometry (velodyne beside calib.txt) or a folder of sequences",
    sequences_at,
    open_semantic_kitti,
)
