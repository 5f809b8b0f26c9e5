"""Poses of the scans of KITTI-360: stated where the vehicle has moved on, between them interpolated.

data_poses/DRIVE/poses.txt            frame, then 3x4: IMU to world
data_poses/DRIVE/cam0_to_world.txt    frame, then 4x4: rectified camera 0 to world
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from data.kitti.reading import read_number_rows
from data.per_frame import FrameTuple, PerFrame
from perception.errors import PoseError
from perception.geometry.se3 import interpolate, inverse, is_rigid, rotation_angle_rad
from perception.types import Float64, Int

# Columns after the frame.
POSES = {"poses.txt": 12, "cam0_to_world.txt": 16}
_TOLERANCE = 1e-2  # of rotations
_MAX_FRAME = 2**31
_MAX_POSITION_M = 1e7
# Between two poses so near in time the way is straight to a few centimetres; where the vehicle has come no farther, it
# stood.
_MAX_GAP_S, _MAX_STEP_M, _MAX_STEP_RAD = 0.5, 1.0, 0.1
_MIN_GAP_S = 1e-9


@dataclass(frozen=True)
class FrameClock:
    """Times of all frames, by those of the scans.

    Attributes:
        frames: (F,) frame number of each scan, rising.
        stamps_s: (F,) time of each scan in seconds, NaN where it is unknown.
        rate_hz: Frames a second where no time is known.
    """

    frames: Int
    stamps_s: Float64
    rate_hz: float

    def time_s(self, frame: int) -> float:
        """Return the time of a frame in seconds, also of one without a scan."""
        is_known = np.isfinite(self.stamps_s)
        if not is_known.any():
            return frame / self.rate_hz
        known = self.frames[is_known]
        beyond = frame - np.clip(frame, known[0], known[-1])
        return float(np.interp(frame, known, self.stamps_s[is_known]) + beyond / self.rate_hz)


@dataclass(frozen=True)
class StatedPoses:
    """P poses of a file.

    Attributes:
        path: File of the poses.
        frames: (P,) frame numbers, rising.
        world_SE3_body: (P, 4, 4) poses.
    """

    path: Path
    frames: Int
    world_SE3_body: Float64

    @classmethod
    def read(cls, path: Path) -> "StatedPoses":
        """Read one of the files of `POSES`.

        Raises:
            PoseError: A row has another number of columns, repeats a frame, or is no rigid transform.
        """
        numbers = read_number_rows(path, 1 + POSES[path.name], PoseError)
        if not len(numbers):
            raise PoseError(path, expected="a row for each pose", found="none")
        frames, poses = numbers[:, 0], np.tile(np.eye(4), (len(numbers), 1, 1))
        poses[:, :3] = numbers[:, 1:13].reshape(-1, 3, 4)
        is_frame = (np.rint(frames) == frames) & (frames >= 0) & (frames < _MAX_FRAME)
        faults = {
            "frame numbers that rise from row to row": is_frame & (np.diff(frames, prepend=-1) > 0),
            "a rotation in columns 1 to 3 of the matrix": is_rigid(poses, _TOLERANCE),
            f"a position within {_MAX_POSITION_M:g} m": np.asarray(
                np.abs(poses[:, :3, 3]) < _MAX_POSITION_M
            ).all(axis=1),
        }
        for expected, is_valid in faults.items():
            if not is_valid.all():
                row = int(is_valid.argmin())
                found = " ".join(f"{number:g}" for number in numbers[row])
                raise PoseError(f"{path} row {row + 1}", expected=expected, found=found)
        return cls(path, frames.astype(np.int64), poses)

    def between(self, frame: int, clock: FrameClock) -> tuple[Float64 | None, bool]:
        """Return the (4, 4) pose of a frame, None where it is not known, and whether poses are near in time."""
        after = int(np.searchsorted(self.frames, frame))
        if after < len(self.frames) and self.frames[after] == frame:
            return self.world_SE3_body[after], True
        if after in (0, len(self.frames)):
            return None, False
        start_s, time_s, end_s = map(
            clock.time_s, (self.frames[after - 1], frame, self.frames[after])
        )
        first, second = self.world_SE3_body[[after - 1, after]]
        is_near = end_s - start_s <= _MAX_GAP_S
        if not (is_near or _is_static(first, second)):
            return None, False
        share = (time_s - start_s) / max(end_s - start_s, _MIN_GAP_S)
        return interpolate(first, second, float(np.clip(share, 0, 1))), is_near


@dataclass(frozen=True)
class ScanPoses(PerFrame):
    """Poses of the scans of a drive.

    Attributes:
        world_SE3_velo: (F) pose of each scan, None where registration alone tells it.
        has_near: (F) whether each scan has a pose that is stated, or those before and after it within half a second.
        origin_m: (3,) origin of this world in that of the file: the first pose, so that positions keep their precision.
        note: Sentence on scans without a pose, empty where all have one.
    """

    world_SE3_velo: FrameTuple[Float64 | None]
    has_near: FrameTuple[bool]
    origin_m: Float64
    note: str

    @classmethod
    def of(cls, stated: StatedPoses, body_SE3_velo: Float64, clock: FrameClock) -> "ScanPoses":
        """Join poses to scans by the frame number, and interpolate where poses are missing.

        Args:
            stated: At least one pose of a body of the vehicle.
            body_SE3_velo: (4, 4) place of the LiDAR on that body.
            clock: Times of the scans.
        """
        file_SE3_velo = stated.world_SE3_body @ body_SE3_velo
        origin_m = file_SE3_velo[0, :3, 3].copy()
        file_SE3_velo[:, :3, 3] -= origin_m
        track = StatedPoses(stated.path, stated.frames, file_SE3_velo)
        frames = clock.frames.tolist()
        found = [track.between(frame, clock) for frame in frames]
        stated_count = len({*frames} & {*stated.frames.tolist()})
        unknown = sum(pose is None for pose, _ in found)
        interpolated = len(frames) - stated_count - unknown
        note = (
            f"{stated.path}: {len(frames) - stated_count} of {len(frames)} scans have no pose: {interpolated} "
            f"interpolated between neighbours, {unknown} left to registration"
        )
        return cls(
            FrameTuple(pose for pose, _ in found),
            FrameTuple(is_near for _, is_near in found),
            origin_m,
            note if stated_count < len(frames) else "",
        )

    def in_file(self, world_SE3_velo: Float64) -> Float64:
        """Return the (4, 4) pose in the world of the file."""
        pose = world_SE3_velo.copy()
        pose[:3, 3] += self.origin_m
        return pose

    def select(self, indices: Sequence[int]) -> "ScanPoses":
        """Return the poses of some scans."""
        poses, has_near = self.world_SE3_velo.select(indices), self.has_near.select(indices)
        return replace(self, world_SE3_velo=poses, has_near=has_near)


def _is_static(before: Float64, after: Float64) -> bool:
    motion = inverse(before) @ after
    is_near = float(np.linalg.norm(motion[:3, 3])) <= _MAX_STEP_M
    return is_near and rotation_angle_rad(motion) <= _MAX_STEP_RAD
