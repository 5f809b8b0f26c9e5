"""KITTI's object benchmark: single frames of many drives, each with its own calibration.

training/velodyne/000000.bin   training/image_2/000000.png
training/calib/000000.txt      training/label_2/000000.txt
training/labels/000000.label   training/sensor.json          (synthetic drives)
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from data.kitti.calibration import read_benchmark_calibration, with_kitti_image_size
from data.kitti.labels import read_object_labels
from data.kitti.sensor_files import (
    IMAGE_SUFFIXES,
    POINT_LABEL_SUFFIXES,
    SCAN_SUFFIXES,
    FrameFiles,
    join_notes,
    list_folder,
    no_scans,
    read_image,
    read_point_truth,
    read_scan,
)
from perception.errors import CalibrationError, DriveError, LabelError
from perception.sensor import LidarModel
from perception.types import Calibration, Frame, Labels, PointTruth, UInt8


def is_object_folder(folder: Path) -> bool:
    """Return whether a folder holds object frames."""
    return any(path.suffix in SCAN_SUFFIXES for path in list_folder(folder / "velodyne"))


@dataclass(frozen=True)
class ObjectFrames:
    """Unrelated frames: no order in time, no poses.

    Frames are those with a scan, in the order of their names.

    Attributes:
        name: Name of the folder.
        root: Training or testing folder.
        sensor: LiDAR model.
        scans: Scans, one per frame.
        images: Images of the left colour camera, or None.
        label_folder: Folder of the labels, or None.
        point_labels: Exact truth of synthetic points, or None.
        calibration: None, as each frame has its own calibration.
        notes: Sentences on files that are not joined to the scans by their names.
    """

    name: str
    root: Path
    sensor: LidarModel
    scans: FrameFiles
    images: FrameFiles | None = None
    label_folder: Path | None = None
    point_labels: FrameFiles | None = None
    calibration: Calibration | None = None
    notes: tuple[str, ...] = ()
    is_sequence: bool = False
    has_poses: bool = False

    @property
    def has_images(self) -> bool:
        """Whether frames carry images."""
        return self.images is not None

    @property
    def has_labels(self) -> bool:
        """Whether there are labelled boxes."""
        return self.label_folder is not None

    def __len__(self) -> int:
        return len(self.scans)

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> Frame:
        """Read one frame.

        Raises:
            PerceptionError: A file of the frame is missing or damaged.
        """
        image = self.image(index)
        path = self.scans.paths[index]
        return Frame(
            index=range(len(self))[index],
            points_velo=read_scan(path),
            stamp_s=range(len(self))[index] / self.sensor.rate_hz,
            image=image,
            calibration=self._calibration(index, image),
            source=str(path),
            name=self.scans.names[index],
            number=self.scans.numbers[index],
        )

    def image(self, index: int) -> UInt8 | None:
        """Read the (H, W, 3) image of one frame without its scan, or None without a camera.

        Raises:
            ImageError: The image is missing or damaged.
        """
        return None if self.images is None else read_image(self.images.paths[index])

    def _calibration(self, index: int, image: UInt8 | None = None) -> Calibration | None:
        folder = self.root / "calib"
        if not folder.is_dir():
            return None
        camera = read_benchmark_calibration(folder / f"{self.scans.paths[index].stem}.txt").camera
        if camera is not None and image is not None:
            camera = replace(camera, image_size_px=(image.shape[1], image.shape[0]))
        return None if camera is None else with_kitti_image_size(camera)

    def labels(self, index: int) -> Labels:
        """Read the labels of one frame.

        Raises:
            DriveError: The folder has no labels.
            LabelError: The frame's label file is missing or cannot be read.
            CalibrationError: The frame has no calibration, which its labels need.
        """
        if self.label_folder is None:
            raise DriveError(self.root, expected="object frames with labels", found="none")
        calibration = self._calibration(index)
        path = self.label_folder / f"{self.scans.paths[index].stem}.txt"
        if calibration is None:
            raise CalibrationError(self.root / "calib", expected=f"one for {path}", found="none")
        if not path.is_file():
            raise LabelError(path, expected="the labels of this frame", found="no file")
        return read_object_labels(path, calibration)

    def point_truth(self, index: int) -> PointTruth | None:
        """Read the exact truth of every point, which only synthetic frames have.

        Raises:
            LabelError: The file is missing, or its length differs from that of the scan.
        """
        if self.point_labels is None:
            return None
        points = len(read_scan(self.scans.paths[index]))
        return read_point_truth(self.point_labels.paths[index], points)


def open_objects(folder: Path, sensor: LidarModel, *, images: bool = True) -> ObjectFrames:
    """Open a training or testing folder of object frames.

    Raises:
        DriveError: The folder holds no scan.
    """
    scans = FrameFiles.within(folder / "velodyne", SCAN_SUFFIXES)
    if not len(scans):
        raise no_scans(scans.folder)
    image_files = FrameFiles.within(folder / "image_2", IMAGE_SUFFIXES)
    point_labels = FrameFiles.within(folder / "labels", POINT_LABEL_SUFFIXES)
    label_folder = folder / "label_2"
    return ObjectFrames(
        name=folder.resolve().name,
        root=folder,
        sensor=sensor,
        scans=scans,
        images=image_files.joined(scans) if images else None,
        label_folder=label_folder if label_folder.is_dir() else None,
        point_labels=point_labels.joined(scans),
        notes=join_notes(scans, {"images": image_files}),
    )
