"""What the layouts of KITTI have in common: files for each frame, read on access."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

from data.kitti.sensor_files import (
    FrameFiles,
    ImageSize,
    read_image,
    read_point_truth,
    read_scan,
)
from perception.sensor import LidarModel
from perception.types import Calibration, Float64, Frame, Labels, PointTruth, UInt8


@dataclass(frozen=True, kw_only=True)
class KittiDrive(ABC):
    """Frames that have a scan, in the order of the names of the scans.

    Attributes:
        name: Name of the drive, the sequence or the folder.
        root: Folder of the drive, or of all sequences.
        sensor: LiDAR model.
        scans: Scans, one per frame.
        calibration: Calibration of the camera in all frames, or None.
        images: Images of the left colour camera, one per scan, or None.
        image_size: Size that every image must have, or None.
        point_labels: Exact truth of synthetic points, one file per scan, or None.
        notes: Sentences on files that are not joined to the scans by their names.
    """

    name: str
    root: Path
    sensor: LidarModel
    scans: FrameFiles
    calibration: Calibration | None = None
    images: FrameFiles | None = None
    image_size: ImageSize | None = None
    point_labels: FrameFiles | None = None
    notes: tuple[str, ...] = ()

    @property
    @abstractmethod
    def is_sequence(self) -> bool:
        """Whether frames follow each other in time."""

    @property
    def has_images(self) -> bool:
        """Whether frames carry images."""
        return self.images is not None

    @property
    @abstractmethod
    def has_poses(self) -> bool:
        """Whether frames carry INS poses."""

    @property
    @abstractmethod
    def has_labels(self) -> bool:
        """Whether there are labelled boxes."""

    def __len__(self) -> int:
        return len(self.scans)

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> Frame:
        """Read one frame.

        Raises:
            PerceptionError: A file of the frame is missing or damaged.
        """
        path, image = self.scans.paths[index], self.image(index)
        return Frame(
            index=range(len(self))[index],
            points_velo=read_scan(path),
            stamp_s=self.stamp_s(index),
            image=image,
            world_SE3_velo=self.world_SE3_velo(index),
            calibration=self.frame_calibration(index, image),
            source=str(path),
            name=self.scans.names[index],
            number=self.scans.numbers[index],
        )

    def select(self, indices: Sequence[int]) -> Self:
        """Return a drive of some frames alone, which keep their numbers and names."""

        def selected(files: FrameFiles | None) -> FrameFiles | None:
            return None if files is None else files.select(indices)

        return replace(
            self,
            scans=self.scans.select(indices),
            images=selected(self.images),
            point_labels=selected(self.point_labels),
        )

    def image(self, index: int) -> UInt8 | None:
        """Read the (H, W, 3) image of one frame without its scan, or None without a camera.

        Raises:
            ImageError: The image is missing, damaged or of another size.
        """
        if self.images is None:
            return None
        return read_image(self.images.paths[index], self.image_size)

    @abstractmethod
    def frame_calibration(self, index: int, image: UInt8 | None = None) -> Calibration | None:
        """Return the calibration of one frame, or None without one.

        Args:
            index: Index of the frame.
            image: (H, W, 3) image of the frame, which has the size where no file states it.

        Raises:
            CalibrationError: The calibration cannot be used.
        """

    @abstractmethod
    def stamp_s(self, index: int) -> float:
        """Return the time of a scan in seconds.

        Raises:
            DriveError: The row of timestamps is missing, or is not a time.
        """

    @abstractmethod
    def world_SE3_velo(self, index: int) -> Float64 | None:
        """Return the (4, 4) INS pose of one frame without reading its scan, or None without INS.

        Raises:
            PoseError: The packet is missing or malformed.
        """

    @abstractmethod
    def labels(self, index: int) -> Labels:
        """Read the labels of one frame.

        Raises:
            DriveError: There are no labels.
            CalibrationError: There is no camera calibration, which labels need.
            LabelError: The labels are missing or cannot be read.
        """

    def point_truth(self, index: int) -> PointTruth | None:
        """Read the exact truth of every point, which only synthetic drives have.

        Raises:
            LabelError: The file is missing, or its length differs from that of the scan.
        """
        if self.point_labels is None:
            return None
        points = len(read_scan(self.scans.paths[index]))
        return read_point_truth(self.point_labels.paths[index], points)
