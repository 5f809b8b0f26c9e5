"""A drive in a bag: frames are read from it one message at a time."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from data.bags.images import read_image_message
from data.bags.ins_poses import PoseSource
from data.bags.message_stream import MessageStream
from data.bags.sweeps import SweepReader
from data.recorded_drive import RecordedDrive
from perception.errors import DriveError
from perception.geometry.undistortion import Lens
from perception.types import Calibration, Float32, Float64, Int, Labels, PointTruth, UInt8


@dataclass(frozen=True)
class BagCamera:
    """The camera of a drive.

    Attributes:
        stream: Its images.
        lens: Its lens, or None where the bag does not state it.
        rows: (F,) message of each scan, -1 for none.
    """

    stream: MessageStream
    lens: Lens | None
    rows: Int


@dataclass(frozen=True, kw_only=True)
class BagDrive(RecordedDrive):
    """Scans of a bag in order of their stamps, with what was recorded around them.

    Attributes:
        sweeps: Scans.
        stamps_ns: (F,) stamps of the scans.
        camera: Camera, or None.
        poses: Poses of the vehicle, or None.
        ins_SE3_velo: (4, 4) transform from the LiDAR to the frame whose poses they are.
        frames: Number of each frame among the scans of the bag.
    """

    sweeps: SweepReader
    stamps_ns: Int
    camera: BagCamera | None = None
    poses: PoseSource | None = None
    ins_SE3_velo: Float64 = field(default_factory=lambda: np.eye(4))
    frames: tuple[int, ...]

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Number of each frame in six digits."""
        return tuple(f"{number:06d}" for number in self.frames)

    @property
    def frame_numbers(self) -> tuple[int, ...]:
        """Number of each frame among the scans of the bag."""
        return self.frames

    @property
    def is_sequence(self) -> bool:
        """Whether frames follow each other in time: yes."""
        return True

    @property
    def has_forward_camera(self) -> bool:
        """Whether the camera is known to face forward: any camera may be chosen."""
        return False

    @property
    def has_images(self) -> bool:
        """Whether frames carry images."""
        return self.camera is not None

    @property
    def has_poses(self) -> bool:
        """Whether frames carry poses of an INS or of odometry."""
        return self.poses is not None

    @property
    def has_labels(self) -> bool:
        """Whether there are labelled boxes: no."""
        return False

    @property
    def has_point_truth(self) -> bool:
        """Whether the class of every point is known: no."""
        return False

    def select(self, indices: Sequence[int]) -> Self:
        """Return a drive of some frames alone, which keep their numbers."""
        return replace(self, frames=tuple(self.frames[index] for index in indices))

    def source(self, index: int) -> str:
        """Return bag, topic and number of the message of a scan."""
        return self.sweeps.where(self.frames[index])

    def points_velo(self, index: int) -> Float32:
        """Read (N, 4) points of all LiDARs."""
        return self.sweeps.read(self.frames[index]).points_velo

    def point_times_s(self, index: int) -> Float32 | None:
        """Read (N,) times of the points in seconds from the stamp, or None where the bag does not state them."""
        return self.sweeps.read(self.frames[index]).times_s

    def image(self, index: int) -> UInt8 | None:
        """Read the undistorted image that is nearest in time; None where none is near."""
        if self.camera is None or (row := int(self.camera.rows[self.frames[index]])) < 0:
            return None
        stream, lens = self.camera.stream, self.camera.lens
        image = read_image_message(stream.read(row), stream.where(row))
        return image if lens is None else lens.undistort(image)

    def frame_calibration(self, index: int, image: UInt8 | None = None) -> Calibration | None:
        """Return the calibration of the drive."""
        return self.calibration

    def stamp_s(self, index: int) -> float:
        """Return the time of a scan since the bag's first."""
        return self._since_first_s(int(self.stamps_ns[self.frames[index]]))

    def _since_first_s(self, stamp_ns: int) -> float:
        return (stamp_ns - int(self.stamps_ns[0])) / 1e9

    def world_SE3_velo(self, index: int) -> Float64 | None:
        """Return the (4, 4) pose at the stamp of a scan, or None where no pose was recorded around it."""
        if self.poses is None:
            return None
        pose = self.poses.world_SE3_ins(int(self.stamps_ns[self.frames[index]]))
        return None if pose is None else pose @ self.ins_SE3_velo

    def labels(self, index: int) -> Labels:
        """Raise DriveError: a bag has no labels."""
        raise DriveError(self.root, expected="a drive with labels", found="a bag, which has none")

    def point_truth(self, index: int) -> PointTruth | None:
        """Return None: a bag does not know the classes of its points."""
        return None
