"""What every drive on disk has in common, whatever its layout: frames that are read on access."""

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from data.drive_images import DriveImages
from data.further_cameras import FurtherCameras
from data.kitti.oxts import InsPacket
from data.labelled_objects import task_classes
from data.per_frame import PerFrame
from data.sweep_motion import SweepMotions
from perception.errors import DriveError, ScanError, UsageError
from perception.localization.deskew import deskew
from perception.sensor import LidarModel
from perception.types import Calibration, Float32, Float64, Frame, Labels, PointTruth, UInt8

_HASH_BYTES = 8  # of a scan: 48 KB of text for 4489 frames in the metadata of a network


@dataclass(frozen=True, kw_only=True)
class RecordedDrive(ABC):
    """Frames that have a scan, in order; a layout says where the parts of a frame come from.

    What a layout does not state otherwise, its drives do not have: poses, labels, truth of points. Frames follow each
    other in time. A field with one entry for each frame is a `PerFrame`, so that `select` cuts it.

    Attributes:
        name: Name of the drive, the sequence or the folder.
        root: Folder or file of the drive, or folder of all sequences.
        sensor: LiDAR model.
        calibration: Calibration of the camera in all frames, or None.
        images: Images of the camera, or None where there are none or they are not loaded.
        camera: Name of that camera in results, where there are several.
        further_cameras: Further cameras, in whose images vehicles are detected too.
        notes: Sentences on data that are not used as they are, or on what was assumed.
        deskew: Whether the points of a sweep are moved to its stamp, by their times and the motion of the LiDAR.
    """

    name: str
    root: Path
    sensor: LidarModel
    calibration: Calibration | None = None
    images: DriveImages | None = None
    camera: str = Frame.camera
    further_cameras: FurtherCameras = field(default_factory=FurtherCameras)
    notes: tuple[str, ...] = ()
    deskew: bool = False
    _motions: SweepMotions = field(
        default_factory=SweepMotions, init=False, repr=False, compare=False
    )

    @property
    @abstractmethod
    def frame_names(self) -> tuple[str, ...]:
        """Name of each frame in results."""

    @property
    @abstractmethod
    def frame_numbers(self) -> tuple[int, ...]:
        """Number of each frame in KITTI's rows."""

    @property
    def is_sequence(self) -> bool:
        """Whether frames follow each other in time."""
        return True

    @property
    def has_images(self) -> bool:
        """Whether frames carry images."""
        return self.images is not None

    @property
    def has_poses(self) -> bool:
        """Whether frames carry poses of an INS or the like."""
        return False

    @property
    def has_labels(self) -> bool:
        """Whether there are labelled boxes."""
        return False

    @property
    def has_point_truth(self) -> bool:
        """Whether the class of every point is known."""
        return False

    @property
    def velo_SE3_imu(self) -> Float64 | None:
        """(4, 4) transform from the IMU to the LiDAR, where the drive has INS packets."""
        return None

    @property
    def origin_ns(self) -> int:
        """Time by the recording's clock at which stamps are 0, in ns since 1970 as far as the clock counts so; 0 if unknown."""
        return 0

    @property
    def has_forward_camera(self) -> bool:
        """Whether the camera is known to face forward, rather than by its calibration alone."""
        return False

    def __len__(self) -> int:
        return len(self.frame_names)

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> Frame:
        """Read one frame.

        Raises:
            PerceptionError: A part of the frame is missing or damaged.
        """
        return self._read(index, with_image=True, with_pose=True)

    def scan(self, index: int) -> Frame:
        """Read one frame without its image and its pose; raise as `__getitem__` does."""
        return self._read(index, with_image=False, with_pose=False)

    def _read(self, index: int, *, with_image: bool, with_pose: bool) -> Frame:
        # Of several cameras one may be dark; the only one may not.
        images = self.images if self.further_cameras.cameras else None
        is_dark = images is not None and images.is_missing(index)
        image = self.image(index) if with_image and not is_dark else None
        return Frame(
            index=range(len(self))[index],
            points_velo=self._deskewed(index) if self.deskew else self.points_velo(index),
            stamp_s=self.stamp_s(index),
            image=image,
            world_SE3_velo=self.world_SE3_velo(index) if with_pose else None,
            calibration=self.frame_calibration(index, image),
            source=self.source(index),
            name=self.frame_names[index],
            number=self.frame_numbers[index],
            point_times_s=self.point_times_s(index),
            camera=self.camera,
            further_cameras=self.further_cameras.at(index, with_images=with_image),
        )

    def _deskewed(self, index: int) -> Float32:
        """Return the points of a sweep at its stamp; as measured where the motion is not known."""
        points_velo, times_s = self.points_velo(index), self.point_times_s(index)
        if times_s is None:
            raise UsageError(
                "--deskew",
                expected="a time for each point",
                found=f"none in {self.source(index)}",
                advice="leave it out",
            )
        span_s = float(times_s.min(initial=0.0)), float(times_s.max(initial=0.0))
        motion = self._motions.motion(self, index, span_s)
        return points_velo if motion is None else deskew(points_velo, times_s, motion)

    def select(self, indices: Sequence[int]) -> Self:
        """Return a drive of some frames alone, which keep their numbers, names, times and poses."""
        parts = ((part.name, getattr(self, part.name)) for part in fields(self))
        cut: dict[str, Any] = {
            name: part.select(indices) for name, part in parts if isinstance(part, PerFrame)
        }
        return replace(self, **cut)

    @abstractmethod
    def source(self, index: int) -> str:
        """Return where the scan of a frame is, for error messages: its file, or its place in a file."""

    @abstractmethod
    def points_velo(self, index: int) -> Float32:
        """Read (N, 4) points: x, y, z in metres and reflectance 0..1; `Frame` validates them.

        Raises:
            ScanError: The scan is missing or damaged.
        """

    def point_times_s(self, index: int) -> Float32 | None:
        """Read (N,) times of the points in seconds from the frame's stamp, or None where they are not known.

        Raises:
            ScanError: The scan is missing or damaged.
        """
        return None

    def image(self, index: int) -> UInt8 | None:
        """Read the (H, W, 3) image of one frame without its scan, or None where it has none.

        Raises:
            ImageError: The image is missing, damaged or of another size.
        """
        return None if self.images is None else self.images.read(index)

    def frame_calibration(self, index: int, image: UInt8 | None = None) -> Calibration | None:
        """Return the calibration of one frame, or None without one.

        Args:
            index: Index of the frame.
            image: (H, W, 3) image of the frame, which has the size where no file states it.

        Raises:
            CalibrationError: The calibration cannot be used.
        """
        return self.calibration

    @abstractmethod
    def stamp_s(self, index: int) -> float:
        """Return the time of a scan in seconds.

        Raises:
            DriveError: It is missing, or is not a time.
        """

    def world_SE3_velo(self, index: int) -> Float64 | None:
        """Return the (4, 4) pose of one frame without reading its scan, or None without poses.

        Raises:
            PoseError: The pose is missing or malformed.
        """
        return None

    def map_SE3_velo(self, index: int) -> Float64:
        """Return the (4, 4) pose of the LiDAR in the world of results in nuScenes' form; the LiDAR itself without poses.

        Raises:
            PoseError: The pose is missing or malformed.
        """
        pose = self.world_SE3_velo(index)
        return np.eye(4) if pose is None else pose

    def sample_token(self, index: int) -> str | None:
        """Return the name of a frame in results of nuScenes' form; None of one that they leave out."""
        return f"{self.frame_numbers[index]:06d}"

    def task_classes(self, index: int, labels: Labels) -> NDArray[np.str_]:
        """Return (M,) classes of the objects around in nuScenes' detection task; empty of what it does not count.

        Args:
            index: Index of the frame.
            labels: Labels of the objects around.
        """
        return task_classes(labels.types.tolist())

    def ins_packet(self, index: int) -> InsPacket | None:
        """Read the INS packet of one frame, or None where poses come from something else.

        Raises:
            PoseError: The packet is missing or malformed.
        """
        return None

    def labels(self, index: int) -> Labels:
        """Read the labels of one frame.

        Raises:
            DriveError: There are no labels.
            CalibrationError: There is no camera calibration, which labels need.
            LabelError: The labels are missing or cannot be read.
        """
        found = "labels of points without instances" if self.has_point_truth else "none"
        raise DriveError(
            self.root,
            expected="a drive with labelled boxes",
            found=found,
            advice="name one with label files, such as a tracking sequence or one that `trifuse synth` wrote",
        )

    def point_truth(self, index: int) -> PointTruth | None:
        """Read the truth of every point, or None where the drive does not know it.

        Raises:
            LabelError: The file is missing, or its length differs from that of the scan.
        """
        return None

    def frame_files(self, index: int) -> tuple[Path, ...]:
        """Return the files that one frame and its labels are made from.

        They stand for the contents of the frame in caches. A drive of which many frames lie in one file has none here:
        its frames are known by their contents.
        """
        return ()

    def fingerprint(self, index: int) -> bytes:
        """Return a hash of the scan of one frame; neither its name nor its place matters."""
        try:
            content = self.points_velo(index).tobytes()
        except ScanError:  # it is met where it is used
            content = self.source(index).encode()
        return hash_scan(content)


def hash_scan(content: bytes) -> bytes:
    """Return the hash by which a scan is known again."""
    return hashlib.blake2b(content, digest_size=_HASH_BYTES).digest()
