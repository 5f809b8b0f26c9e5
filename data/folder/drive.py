"""A drive of one folder: scans in any format, with the parts that its drive.yaml names."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from data.clouds.cloud import Cloud
from data.clouds.read_cloud import read_cloud
from data.file_drive import FileDrive
from data.folder.config import Viewpoint
from data.folder.pose_track import PoseTrack
from data.kitti.labels import empty_labels, read_object_labels, require_tracking_labels
from data.kitti.sensor_files import FrameFiles
from data.packets.recording import Recording
from data.per_frame import FrameTuple
from perception.geometry.se3 import inverse, transform_points
from perception.types import Float32, Float64, Labels

_EPOCH_S = 1e6  # times of points beyond are by a clock, and not from the start of the scan
_MAX_POINT_TIME_S = 0.99


@dataclass(frozen=True, kw_only=True)
class FolderDrive(FileDrive):
    """Frames of one folder.

    Attributes:
        columns: Names of the columns of the scans, or None for those of the files.
        velo_SE3_lidar: (4, 4) turn from the axes of the files to x forward, y left, z up on a level road.
        reflectance_scale: Value in the files of a reflectance of 1.
        viewpoint: Whether points are moved by the VIEWPOINT of their file, by its inverse, or not.
        stamps_ns: (F,) times of the scans in nanoseconds.
        origin_ns: Time from which seconds are counted.
        rows: Place of each frame among all scans of the folder.
        recording: Packets of which the scans are sweeps, or None where they are files.
        poses: Poses of the body, or None.
        body_SE3_velo: (4, 4) transform from the LiDAR to the body of the poses.
        label_file: Labels in KITTI's tracking format, or folder of its rows of each scan; None without them.
    """

    columns: tuple[str, ...] | None = None
    velo_SE3_lidar: Float64
    reflectance_scale: float = 1.0
    viewpoint: Viewpoint = "ignored"
    stamps_ns: FrameTuple[int]
    origin_ns: int = 0
    rows: FrameTuple[int]
    recording: Recording | None = None
    poses: PoseTrack | None = None
    body_SE3_velo: Float64 | None = None
    label_file: Path | None = None

    @property
    def has_poses(self) -> bool:
        """Whether frames carry poses."""
        return self.poses is not None

    @property
    def has_labels(self) -> bool:
        """Whether there are labelled boxes."""
        return self.label_file is not None

    def points_velo(self, index: int) -> Float32:
        """Read the points of one frame, turned to x forward, y left, z up."""
        cloud = self._cloud(index)
        points = np.zeros((len(cloud), 4), np.float32)
        points[:, :3] = cloud.xyz
        if cloud.intensity is not None and self.reflectance_scale == 1:
            points[:, 3] = cloud.intensity
        elif cloud.intensity is not None:
            np.clip(cloud.intensity / np.float32(self.reflectance_scale), 0, 1, out=points[:, 3])
        velo_SE3_file = self.velo_SE3_file(index)
        is_moved = not np.array_equal(velo_SE3_file, np.eye(4))
        return transform_points(velo_SE3_file, points) if is_moved else points

    def velo_SE3_file(self, index: int) -> Float64:
        """Return the (4, 4) transform from the axes of the file of one scan to the LiDAR frame."""
        cloud = None if self.viewpoint == "ignored" else self._cloud(index)
        if cloud is None or cloud.viewpoint is None:
            return self.velo_SE3_lidar
        pose = cloud.viewpoint if self.viewpoint == "applied" else inverse(cloud.viewpoint)
        return np.asarray(self.velo_SE3_lidar @ pose)

    def point_times_s(self, index: int) -> Float32 | None:
        """Read the times of the points from the frame's stamp; None where they are not those of one turn."""
        times_s = self._cloud(index).times_s
        if times_s is None or not np.isfinite(times_s).any():
            return None
        known_s = times_s[np.isfinite(times_s) & (times_s != 0)]
        first_s = float(known_s.min()) if len(known_s) else 0.0
        if first_s > _EPOCH_S:
            stamp_s = self.stamps_ns[index] / 1e9
            times_s = times_s - (stamp_s if abs(first_s - stamp_s) < _MAX_POINT_TIME_S else first_s)
        is_known = np.abs(times_s) < _MAX_POINT_TIME_S
        if is_known.mean() < 0.5:
            return None
        return np.where(is_known, times_s, 0.0).astype(np.float32)

    def stamp_s(self, index: int) -> float:
        """Return the time of a scan since the drive's first."""
        return (self.stamps_ns[index] - self.origin_ns) / 1e9

    def world_SE3_velo(self, index: int) -> Float64 | None:
        """Return the (4, 4) pose of one frame, interpolated at the time of its scan."""
        if self.poses is None or self.body_SE3_velo is None:
            return None
        pose = self.poses.at(self.rows[index], self.stamps_ns[index], 1 / self.sensor.rate_hz)
        return np.asarray(pose @ self.body_SE3_velo)

    def labels(self, index: int) -> Labels:
        """Return the labels of one frame; none where the file has no row of it."""
        return self._labels_by_number.get(self.frame_numbers[index], empty_labels())

    @cached_property
    def _labels_by_number(self) -> Mapping[int, Labels]:
        if self.label_file is not None and self.label_file.is_dir():
            files = FrameFiles.within(self.label_file, (".txt",)).joined(self.scans)
            numbered = () if files is None else zip(self.frame_numbers, files.paths, strict=True)
            return {
                number: read_object_labels(path, self.calibration)
                for number, path in numbered
                if path.is_file() and self.calibration is not None
            }
        advice = "add a section camera to drive.yaml"
        return require_tracking_labels(self.root, self.label_file, self.calibration, advice)

    def _count_points(self, index: int) -> int:
        return len(self._cloud(index))

    def _texts(self, index: int) -> tuple[Path | None, ...]:
        file = self.label_file
        is_folder = file is not None and file.is_dir()
        return (file / f"{self.scans.paths[index].stem}.txt" if file and is_folder else file,)

    def frame_files(self, index: int) -> tuple[Path, ...]:
        """Return the files of one frame; none of a recording, in which all frames are one file."""
        return () if self.recording is not None else super().frame_files(index)

    def _cloud(self, index: int) -> Cloud:
        path = self.scans.paths[index]
        if self.recording is not None:
            return self.recording.cloud(self.rows[index])
        state = path.stat() if path.exists() else None
        return _read_once(path, self.columns, state and (state.st_size, state.st_mtime_ns))


@lru_cache(maxsize=2)
def _read_once(path: Path, columns: tuple[str, ...] | None, state: object) -> Cloud:
    """Read a cloud; its points and their times are asked for one after the other."""
    return read_cloud(path, columns)


def velo_to_body(body_SE3_lidar: Float64 | None, velo_SE3_lidar: Float64) -> Float64:
    """Return the (4, 4) transform from the level LiDAR frame to that of a body.

    Args:
        body_SE3_lidar: (4, 4) transform from the axes of the files to the body; None where they are the same.
        velo_SE3_lidar: (4, 4) turn from the axes of the files to the level LiDAR frame.
    """
    lidar_SE3_velo = inverse(velo_SE3_lidar)
    return lidar_SE3_velo if body_SE3_lidar is None else body_SE3_lidar @ lidar_SE3_velo
