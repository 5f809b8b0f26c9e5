"""A drive in a bag: frames are read from it one message at a time."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from data.bags.images import read_image_message
from data.bags.ins_poses import PoseSource
from data.bags.message_stream import MessageStream
from data.bags.sweeps import SweepReader
from data.drive_images import DriveImages
from data.per_frame import FrameTuple
from data.recorded_drive import RecordedDrive
from perception.geometry.undistortion import Lens
from perception.types import Float32, Float64, Int, UInt8


@dataclass(frozen=True)
class BagImages(DriveImages):
    """Undistorted images of a topic.

    Attributes:
        stream: Messages.
        lens: Lens of the camera, or None where the bag does not state it.
        rows: (F,) message of each scan, -1 for none.
    """

    stream: MessageStream
    lens: Lens | None
    rows: FrameTuple[int]

    def select(self, indices: Sequence[int]) -> Self:
        """Return the images of some frames."""
        return replace(self, rows=self.rows.select(indices))

    def read(self, index: int) -> UInt8 | None:
        """Read the undistorted image that is nearest in time; None where none is near."""
        row = self.rows[index]
        if row < 0:
            return None
        image = read_image_message(self.stream.read(row), self.stream.where(row))
        return image if self.lens is None else self.lens.undistort(image)


@dataclass(frozen=True, kw_only=True)
class BagDrive(RecordedDrive):
    """Scans of a bag in order of their stamps, with what was recorded around them.

    Attributes:
        sweeps: Scans.
        stamps_ns: (F,) stamps of the scans.
        poses: Poses of the vehicle, or None.
        ins_SE3_velo: (4, 4) transform from the LiDAR to the frame whose poses they are.
        frames: Number of each frame among the scans of the bag.
    """

    sweeps: SweepReader
    stamps_ns: Int
    poses: PoseSource | None = None
    ins_SE3_velo: Float64 = field(default_factory=lambda: np.eye(4))
    frames: FrameTuple[int]

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Number of each frame in six digits."""
        return tuple(f"{number:06d}" for number in self.frames)

    @property
    def frame_numbers(self) -> tuple[int, ...]:
        """Number of each frame among the scans of the bag."""
        return self.frames

    @property
    def has_poses(self) -> bool:
        """Whether frames carry poses of an INS or of odometry."""
        return self.poses is not None

    def source(self, index: int) -> str:
        """Return bag, topic and number of the message of a scan."""
        return self.sweeps.where(self.frames[index])

    def points_velo(self, index: int) -> Float32:
        """Read (N, 4) points of all LiDARs."""
        return self.sweeps.read(self.frames[index]).points_velo

    def point_times_s(self, index: int) -> Float32 | None:
        """Read (N,) times of the points in seconds from the stamp, or None where the bag does not state them."""
        return self.sweeps.read(self.frames[index]).times_s

    def stamp_s(self, index: int) -> float:
        """Return the time of a scan since the bag's first."""
        return (int(self.stamps_ns[self.frames[index]]) - self.origin_ns) / 1e9

    @property
    def origin_ns(self) -> int:
        """Stamp of the bag's first scan."""
        return int(self.stamps_ns[0])

    def world_SE3_velo(self, index: int) -> Float64 | None:
        """Return the (4, 4) pose at the stamp of a scan, or None where no pose was recorded around it."""
        if self.poses is None:
            return None
        pose = self.poses.world_SE3_ins(int(self.stamps_ns[self.frames[index]]))
        return None if pose is None else pose @ self.ins_SE3_velo
