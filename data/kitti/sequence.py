"""Frames of one recording in order of time: the common part of the raw and the tracking layout."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Protocol

from data.kitti.calibration import DriveCalibration, with_kitti_image_size
from data.kitti.labels import empty_labels, read_tracking_labels
from data.kitti.oxts import InsPacket, Mercator
from data.kitti.sensor_files import (
    ImageSize,
    NumberedFiles,
    read_image,
    read_point_truth,
    read_scan,
)
from perception.errors import CalibrationError, DriveError, ImageError, PoseError
from perception.geometry.se3 import inverse
from perception.sensor import LidarModel
from perception.types import Calibration, Float64, Frame, Labels, PointTruth, UInt8


class InsSource(Protocol):
    """Source of the INS packets of a drive."""

    def packet(self, number: int) -> InsPacket:
        """Read the packet of a frame; raise PoseError where it is missing or malformed."""
        ...


class Clock(Protocol):
    """Clock of the scans of a drive."""

    def stamp_s(self, number: int) -> float:
        """Return the time of a frame's scan since the drive's first."""
        ...


@dataclass(frozen=True)
class FixedRateClock:
    """Clock for drives without timestamps: the sensor turns at its nominal rate.

    Attributes:
        rate_hz: Scans per second.
        first_number: Number of the drive's first frame.
    """

    rate_hz: float
    first_number: int

    def stamp_s(self, number: int) -> float:
        """Return the time of a frame's scan since the drive's first."""
        return (number - self.first_number) / self.rate_hz


@dataclass(frozen=True)
class KittiSequence:
    """Drive whose frames are read on access.

    Attributes:
        name: Name of the raw drive or the tracking sequence.
        root: Folder of the drive, or of all sequences.
        sensor: LiDAR model.
        calibration: Calibration of the camera, with the image size where a file states it.
        scans: Scans, one per frame; a number without a scan between the first and the last is a missing frame.
        clock: Clock of the scans.
        images: Images of the left colour camera, or None.
        image_size: Size that every image must have, or None.
        ins: INS packets, or None.
        velo_SE3_imu: (4, 4) transform from the IMU to the LiDAR; required with `ins`.
        label_file: Labels in tracking format, or None.
        point_labels: Exact truth of synthetic points, or None.
    """

    name: str
    root: Path
    sensor: LidarModel
    calibration: Calibration | None
    scans: NumberedFiles
    clock: Clock
    images: NumberedFiles | None = None
    image_size: ImageSize | None = None
    ins: InsSource | None = None
    velo_SE3_imu: Float64 | None = None
    label_file: Path | None = None
    point_labels: NumberedFiles | None = None
    is_sequence: bool = True

    def __post_init__(self) -> None:
        """Validate that an INS has a calibration, without which its poses cannot be used."""
        if self.ins is not None and self.velo_SE3_imu is None:
            raise CalibrationError(
                self.root,
                expected="an IMU-to-LiDAR calibration for the INS packets of this drive",
                found="none",
                advice="add the drive's calibration files, or move its oxts folder away",
            )

    @property
    def has_images(self) -> bool:
        """Whether frames carry images."""
        return self.images is not None

    @property
    def has_poses(self) -> bool:
        """Whether frames carry INS poses."""
        return self.ins is not None

    @property
    def has_labels(self) -> bool:
        """Whether there are labelled boxes."""
        return self.label_file is not None

    def __len__(self) -> int:
        return len(self.scans.numbers)

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> Frame:
        """Read one frame.

        Raises:
            PerceptionError: A file of the frame is missing or damaged.
        """
        number = self.scans.numbers[index]
        path = self.scans.path(number)
        return Frame(
            index=number - self.scans.numbers[0],
            points_velo=read_scan(path),
            stamp_s=self.clock.stamp_s(number),
            image=self.image(index),
            world_SE3_velo=self._world_SE3_velo(number),
            calibration=self.calibration,
            source=str(path),
        )

    def _world_SE3_velo(self, number: int) -> Float64 | None:
        if self.ins is None or self.velo_SE3_imu is None:
            return None
        return self._world.world_SE3_imu(self.ins.packet(number)) @ inverse(self.velo_SE3_imu)

    @cached_property
    def _world(self) -> Mercator:
        """World frame with its origin at the first readable packet."""
        failure: PoseError | None = None
        for number in self.scans.numbers:
            try:
                return Mercator.around(self._packet(number))
            except PoseError as error:
                failure = failure or error
        raise failure or PoseError(self.root, expected="an INS packet", found="none")

    def _packet(self, number: int) -> InsPacket:
        if self.ins is None:
            raise DriveError(self.root, expected="a drive with INS packets", found="none")
        return self.ins.packet(number)

    def image(self, index: int) -> UInt8 | None:
        """Read the (H, W, 3) image of one frame without its scan, or None without a camera.

        Raises:
            ImageError: The image is missing, damaged or of another size.
        """
        if self.images is None:
            return None
        return read_image(self.images.path(self.scans.numbers[index]), self.image_size)

    def ins_packet(self, index: int) -> InsPacket:
        """Read the INS packet of one frame.

        Raises:
            DriveError: The drive has no INS.
            PoseError: The packet is missing or malformed.
        """
        return self._packet(self.scans.numbers[index])

    def world_SE3_velo(self, index: int) -> Float64 | None:
        """Return the (4, 4) INS pose of one frame without reading its scan, or None without INS.

        Raises:
            PoseError: The packet is missing or malformed.
        """
        return self._world_SE3_velo(self.scans.numbers[index])

    def labels(self, index: int) -> Labels:
        """Read the labels of one frame.

        Raises:
            DriveError: The drive has no labels.
            LabelError: The label file cannot be read.
        """
        return self._labels_by_number.get(self.scans.numbers[index], empty_labels())

    @cached_property
    def _labels_by_number(self) -> Mapping[int, Labels]:
        if self.label_file is None:
            raise DriveError(self.root, expected="a drive with labels", found="none")
        if self.calibration is None:
            raise DriveError(
                self.root,
                expected=f"a camera calibration to place the labels of {self.label_file.name}",
                found="none",
            )
        return read_tracking_labels(self.label_file, self.calibration)

    def point_truth(self, index: int) -> PointTruth | None:
        """Read the exact truth of every point, which only synthetic drives have.

        Raises:
            LabelError: The file is missing, or its length differs from that of the scan.
        """
        if self.point_labels is None:
            return None
        number = self.scans.numbers[index]
        return read_point_truth(
            self.point_labels.path(number), len(read_scan(self.scans.path(number)))
        )


@dataclass(frozen=True)
class CameraFiles:
    """Images of a drive and their calibration.

    Attributes:
        calibration: Calibration with the image size, where the calibration or the first image states it.
        image_size: Image size, and the file that states it.
        images: Image files, or None where there are none or they are not to be loaded.
    """

    calibration: Calibration | None
    image_size: ImageSize | None
    images: NumberedFiles | None

    @classmethod
    def of(
        cls, calibration: DriveCalibration, images: NumberedFiles, *, load_images: bool
    ) -> "CameraFiles":
        """Combine the calibration and the images of a drive."""
        camera = calibration.camera
        size = _find_image_size(camera, images)
        if camera is not None:
            known = camera if size is None else replace(camera, image_size_px=size.size_px)
            camera = with_kitti_image_size(known)
        return cls(camera, size, images if load_images and len(images) else None)


def _find_image_size(camera: Calibration | None, images: NumberedFiles) -> ImageSize | None:
    if camera is not None and camera.image_size_px is not None:
        return ImageSize(camera.image_size_px, source=camera.source)
    for path in images.paths.values():
        try:
            height, width = read_image(path).shape[:2]
        except ImageError:
            continue  # reported when the frame is read
        return ImageSize((width, height), source=f"{path}, the drive's first,")
    return None
