"""Frames of one recording in order of time: the common part of the raw and the tracking layout."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from data.drive_images import ImageFiles
from data.kitti.calibration import with_kitti_image_size
from data.kitti.drive import KittiDrive
from data.kitti.image_joining import JoinedImages
from data.kitti.labels import empty_labels, require_tracking_labels
from data.kitti.oxts import InsPacket, Mercator
from data.kitti.sensor_files import (
    FrameFiles,
    ImageSize,
    read_image,
)
from data.kitti.timestamps import (
    first_known,
    read_timestamps,
    seconds_since,
    timestamp_rows,
)
from data.per_frame import PerFrame
from perception.errors import CalibrationError, DriveError, ImageError, PoseError
from perception.geometry.se3 import inverse
from perception.types import Calibration, Float64, Labels


class InsSource(PerFrame, ABC):
    """Source of the INS packets of a drive."""

    @abstractmethod
    def packet(self, index: int) -> InsPacket:
        """Read the packet of a frame; raise PoseError where it is missing or malformed."""


@dataclass(frozen=True)
class ScanClock(PerFrame):
    """Times of the scans of a drive.

    Attributes:
        stamps_s: (F,) seconds since the first time of the drive, NaN where it is unknown.
        rows: Row of each scan in the file of timestamps; none without a file.
        path: File of timestamps, for error messages.
        origin: First time of the drive; None where the drive states no times.
    """

    stamps_s: Float64
    rows: tuple[int, ...] = ()
    path: Path | None = None
    origin: np.datetime64 | None = None

    @classmethod
    def of(cls, path: Path, scans: FrameFiles, rate_hz: float) -> "ScanClock":
        """Read the times of KITTI's timestamps.txt; without that file as `without_timestamps`.

        Raises:
            DriveError: The file is not text.
        """
        if not path.is_file():
            return cls.without_timestamps(scans, rate_hz)
        timestamps = read_timestamps(path)
        rows = timestamp_rows(timestamps, scans)
        origin = first_known(timestamps)
        stamps_s = seconds_since(timestamps, origin)
        of_scans_s = [stamps_s[row] if row < len(stamps_s) else np.nan for row in rows]
        return cls(np.array(of_scans_s), rows, path, origin)

    @classmethod
    def without_timestamps(cls, scans: FrameFiles, rate_hz: float) -> "ScanClock":
        """Return the Unix times that the scans are named by, else the times of a steady rate."""
        if scans.unix_times is not None:
            origin = scans.unix_times[0]
            return cls(seconds_since(scans.unix_times, origin), origin=origin)
        return cls((np.array(scans.numbers) - scans.numbers[0]) / rate_hz)

    @property
    def origin_ns(self) -> int:
        """Time at which stamps are 0; KITTI's rows name no time zone, and are taken for UTC."""
        return 0 if self.origin is None else int(self.origin.astype("datetime64[ns]").astype(int))

    def select(self, indices: Sequence[int]) -> "ScanClock":
        """Return the times of some scans."""
        rows = tuple(self.rows[index] for index in indices) if self.rows else ()
        return replace(self, stamps_s=self.stamps_s[list(indices)], rows=rows)

    def stamp_s(self, index: int) -> float:
        """Return the time of a frame's scan.

        Raises:
            DriveError: The row is missing, or is not a time.
        """
        stamp_s = float(self.stamps_s[index])
        if np.isnan(stamp_s):
            raise DriveError(
                f"{self.path} row {self.rows[index] + 1}",
                expected="a time such as 2011-09-26 13:04:32.335337762",
                found="no such row, or another text",
                advice="correct the row, or remove the file for a steady clock",
            )
        return stamp_s


@dataclass(frozen=True, kw_only=True)
class KittiSequence(KittiDrive):
    """Frames of one recording.

    Attributes:
        clock: Times of the scans.
        ins: INS packets, or None.
        velo_SE3_imu: (4, 4) transform from the IMU to the LiDAR; required with `ins`.
        label_file: Labels in tracking format, or None.
    """

    clock: ScanClock
    ins: InsSource | None = None
    velo_SE3_imu: Float64 | None = None
    label_file: Path | None = None

    def __post_init__(self) -> None:
        """Validate that an INS has a calibration, without which its poses cannot be used."""
        if self.ins is not None and self.velo_SE3_imu is None:
            raise CalibrationError(
                self.root,
                expected="an IMU-to-LiDAR calibration for the INS packets of this drive",
                found="none",
                advice="add the drive's calibration files, or move its oxts folder away",
            )

    def _texts(self, index: int) -> tuple[Path, ...]:
        return () if self.label_file is None else (self.label_file,)

    @property
    def origin_ns(self) -> int:
        """Time at which stamps are 0."""
        return self.clock.origin_ns

    @property
    def has_poses(self) -> bool:
        """Whether frames carry INS poses."""
        return self.ins is not None

    @property
    def has_labels(self) -> bool:
        """Whether there are labelled boxes."""
        return self.label_file is not None

    @cached_property
    def _world(self) -> Mercator:
        """World frame with its origin at the first readable packet."""
        failure: PoseError | None = None
        for index in range(len(self)):
            try:
                if (packet := self.ins_packet(index)) is not None:
                    return Mercator.around(packet)
            except PoseError as error:
                failure = failure or error
        raise failure or PoseError(self.root, expected="an INS packet", found="none")

    def stamp_s(self, index: int) -> float:
        """Return the time of a scan since the drive's first."""
        return self.clock.stamp_s(index)

    def ins_packet(self, index: int) -> InsPacket | None:
        """Read the INS packet of one frame."""
        return None if self.ins is None else self.ins.packet(index)

    def world_SE3_velo(self, index: int) -> Float64 | None:
        """Return the (4, 4) INS pose of one frame."""
        if self.ins is None or self.velo_SE3_imu is None:
            return None
        return self._world.world_SE3_imu(self.ins.packet(index)) @ inverse(self.velo_SE3_imu)

    def labels(self, index: int) -> Labels:
        """Return the labels of one frame; none where the file has no row of it."""
        return self._labels_by_number.get(self.scans.numbers[index], empty_labels())

    @cached_property
    def _labels_by_number(self) -> Mapping[int, Labels]:
        advice = "add the drive's calibration files"
        return require_tracking_labels(self.root, self.label_file, self.calibration, advice)


@dataclass(frozen=True)
class CameraFiles:
    """Images of a drive and their calibration.

    Attributes:
        calibration: Calibration with the image size, where the calibration or the first image states it.
        images: Image of each scan; None without images or where they are not loaded.
    """

    calibration: Calibration | None
    images: ImageFiles | None

    @classmethod
    def of(
        cls,
        calibration: Calibration | None,
        images: FrameFiles,
        joined: JoinedImages,
        *,
        load: bool,
    ) -> "CameraFiles":
        """Combine the calibration and the images of a drive.

        Args:
            calibration: Calibration of the camera, or None.
            images: Images of the left colour camera.
            joined: Image of each scan.
            load: Whether frames carry images.
        """
        size = _find_image_size(calibration, images)
        if calibration is not None:
            known = (
                calibration if size is None else replace(calibration, image_size_px=size.size_px)
            )
            calibration = with_kitti_image_size(known)
        if joined.paths is None or not load:
            return cls(calibration, None)
        return cls(calibration, ImageFiles(joined.paths, size))


def _find_image_size(camera: Calibration | None, images: FrameFiles) -> ImageSize | None:
    if camera is not None and camera.image_size_px is not None:
        return ImageSize(camera.image_size_px, source=camera.source)
    for path in images.paths:
        try:
            height, width = read_image(path).shape[:2]
        except ImageError:
            continue  # reported when the frame is read
        return ImageSize((width, height), source=f"{path}, the drive's first,")
    return None
