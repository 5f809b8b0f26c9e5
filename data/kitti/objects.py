"""KITTI's object benchmark: single frames of many drives, each with its own calibration.

training/velodyne/000000.bin   training/image_2/000000.png
training/calib/000000.txt      training/label_2/000000.txt
training/labels/000000.label   training/sensor.json          (synthetic drives)
"""

from dataclasses import dataclass, replace
from pathlib import Path

from data.drive_images import ImageFiles
from data.kitti.calibration import read_benchmark_calibration, with_kitti_image_size
from data.kitti.drive import KittiDrive, find_reflectance_scale
from data.kitti.image_joining import join_images
from data.kitti.labels import read_object_labels
from data.kitti.sensor_files import (
    IMAGE_SUFFIXES,
    POINT_LABEL_SUFFIXES,
    SCAN_SUFFIXES,
    FrameFiles,
    list_folder,
    scans_in,
)
from data.layouts import OpenConfig
from perception.errors import CalibrationError
from perception.types import Calibration, Labels, UInt8


def is_object_folder(folder: Path) -> bool:
    """Return whether a folder holds object frames."""
    return any(path.suffix in SCAN_SUFFIXES for path in list_folder(folder / "velodyne"))


@dataclass(frozen=True, kw_only=True)
class ObjectFrames(KittiDrive):
    """Unrelated frames: no order in time, no poses.

    Each frame has a calibration of its own.

    Attributes:
        label_folder: Folder of the labels, or None.
    """

    label_folder: Path | None = None

    @property
    def is_sequence(self) -> bool:
        """Whether frames follow each other in time: no."""
        return False

    @property
    def has_labels(self) -> bool:
        """Whether there are labelled boxes."""
        return self.label_folder is not None

    def _texts(self, index: int) -> tuple[Path, ...]:
        stem = self.scans.paths[index].stem
        return tuple(self.root / folder / f"{stem}.txt" for folder in ("calib", "label_2"))

    def stamp_s(self, index: int) -> float:
        """Return a time that rises from frame to frame."""
        return range(len(self))[index] / self.sensor.rate_hz

    def frame_calibration(self, index: int, image: UInt8 | None = None) -> Calibration | None:
        """Read the calibration of one frame."""
        folder = self.root / "calib"
        if not folder.is_dir():
            return None
        camera = read_benchmark_calibration(folder / f"{self.scans.paths[index].stem}.txt").camera
        if camera is not None and image is not None:
            camera = replace(camera, image_size_px=(image.shape[1], image.shape[0]))
        return None if camera is None else with_kitti_image_size(camera)

    def labels(self, index: int) -> Labels:
        """Read the labels of one frame."""
        if self.label_folder is None:
            return super().labels(index)
        calibration = self.frame_calibration(index)
        path = self.label_folder / f"{self.scans.paths[index].stem}.txt"
        if calibration is None:
            raise CalibrationError(self.root / "calib", expected=f"one for {path}", found="none")
        return read_object_labels(path, calibration)


def open_objects(folder: Path, config: OpenConfig) -> ObjectFrames:
    """Open a training or testing folder of object frames.

    Raises:
        DriveError: The folder holds no scan.
    """
    scans = scans_in(folder / "velodyne")
    image_files = FrameFiles.within(folder / config.camera_among(("image_2",)), IMAGE_SUFFIXES)
    point_labels = FrameFiles.within(folder / "labels", POINT_LABEL_SUFFIXES)
    label_folder = folder / "label_2"
    joined = join_images(scans, image_files, scans.unix_times, image_files.unix_times)
    reflectance = find_reflectance_scale(scans, config)
    return ObjectFrames(
        name=folder.resolve().name,
        root=folder,
        sensor=config.lidar_model(folder),
        scans=scans,
        images=ImageFiles(joined.paths) if joined.paths and config.images else None,
        label_folder=label_folder if label_folder.is_dir() else None,
        point_labels=point_labels.joined(scans),
        reflectance_scale=reflectance.scale,
        notes=(*joined.notes, *reflectance.notes),
    )
