"""A drive of one folder: scans in any format, with the parts that its drive.yaml names."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Self

import numpy as np

from data.clouds.cloud import Cloud
from data.clouds.read_cloud import read_cloud
from data.folder.pose_track import PoseTrack
from data.kitti.labels import empty_labels, require_tracking_labels
from data.kitti.sensor_files import SKIP_ADVICE, FrameFiles, read_image, read_point_truth
from data.recorded_drive import RecordedDrive
from perception.errors import ImageError
from perception.geometry.se3 import inverse, transform_points
from perception.geometry.undistortion import Lens
from perception.types import Calibration, Float32, Float64, Int, Labels, PointTruth, UInt8

_EPOCH_S = 1e6  # times of points beyond are by a clock, and not from the start of the scan
_MAX_POINT_TIME_S = 0.99


@dataclass(frozen=True)
class ImageFiles:
    """Image of each scan.

    Attributes:
        paths: Image of each scan; None where none is near enough in time.
        lens: Lens of the camera, or None without a calibration.
    """

    paths: tuple[Path | None, ...]
    lens: Lens | None


@dataclass(frozen=True, kw_only=True)
class FolderDrive(RecordedDrive):
    """Frames of one folder.

    Attributes:
        scans: Scans, one a frame.
        columns: Names of the columns of the scans, or None for those of the files.
        velo_SE3_lidar: (4, 4) turn from the axes of the files to x forward, y left, z up on a level road.
        reflectance_scale: Value in the files of a reflectance of 1.
        stamps_ns: (F,) times of the scans in nanoseconds.
        origin_ns: Time from which seconds are counted.
        rows: Place of each frame among all scans of the folder.
        images: Images, or None where there are none or they are not to be loaded.
        poses: Poses of the body, or None.
        body_SE3_velo: (4, 4) transform from the LiDAR to the body of the poses.
        label_file: Labels in KITTI's tracking format, or None.
        point_labels: SemanticKITTI's labels of the points, or None.
    """

    scans: FrameFiles
    columns: tuple[str, ...] | None = None
    velo_SE3_lidar: Float64
    reflectance_scale: float = 1.0
    stamps_ns: Int
    origin_ns: int
    rows: tuple[int, ...]
    images: ImageFiles | None = None
    poses: PoseTrack | None = None
    body_SE3_velo: Float64 | None = None
    label_file: Path | None = None
    point_labels: FrameFiles | None = None

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Name of each frame: its number in six digits, or the name of its file."""
        return self.scans.names

    @property
    def frame_numbers(self) -> tuple[int, ...]:
        """Number of each frame: that in the name of its file, or its place."""
        return self.scans.numbers

    @property
    def is_sequence(self) -> bool:
        """Whether frames follow each other in time: yes."""
        return True

    @property
    def has_images(self) -> bool:
        """Whether frames carry images."""
        return self.images is not None

    @property
    def has_poses(self) -> bool:
        """Whether frames carry poses."""
        return self.poses is not None

    @property
    def has_labels(self) -> bool:
        """Whether there are labelled boxes."""
        return self.label_file is not None

    @property
    def has_point_truth(self) -> bool:
        """Whether the class of every point is known."""
        return self.point_labels is not None

    def select(self, indices: Sequence[int]) -> Self:
        """Return a drive of some frames alone, at their own times and poses."""
        images, labels = self.images, self.point_labels
        return replace(
            self,
            scans=self.scans.select(indices),
            stamps_ns=self.stamps_ns[list(indices)],
            rows=tuple(self.rows[index] for index in indices),
            images=images and replace(images, paths=tuple(images.paths[i] for i in indices)),
            point_labels=labels and labels.select(indices),
        )

    def source(self, index: int) -> str:
        """Return the file of a scan."""
        return str(self.scans.paths[index])

    def points_velo(self, index: int) -> Float32:
        """Read the points of one frame, turned to x forward, y left, z up."""
        cloud = self._cloud(index)
        points = np.zeros((len(cloud), 4), np.float32)
        points[:, :3] = cloud.xyz
        if cloud.intensity is not None and self.reflectance_scale == 1:
            points[:, 3] = cloud.intensity
        elif cloud.intensity is not None:
            np.clip(cloud.intensity / np.float32(self.reflectance_scale), 0, 1, out=points[:, 3])
        is_turned = not np.array_equal(self.velo_SE3_lidar, np.eye(4))
        return transform_points(self.velo_SE3_lidar, points) if is_turned else points

    def point_times_s(self, index: int) -> Float32 | None:
        """Read the times of the points from the frame's stamp; None where they are not those of one turn."""
        times_s = self._cloud(index).times_s
        if times_s is None or not np.isfinite(times_s).any():
            return None
        known_s = times_s[np.isfinite(times_s) & (times_s != 0)]
        first_s = float(known_s.min()) if len(known_s) else 0.0
        if first_s > _EPOCH_S:
            stamp_s = float(self.stamps_ns[index]) / 1e9
            times_s = times_s - (stamp_s if abs(first_s - stamp_s) < _MAX_POINT_TIME_S else first_s)
        is_known = np.abs(times_s) < _MAX_POINT_TIME_S
        if is_known.mean() < 0.5:
            return None
        return np.where(is_known, times_s, 0.0).astype(np.float32)

    def image(self, index: int) -> UInt8 | None:
        """Read the image of one frame, undistorted."""
        if self.images is None:
            return None
        path, lens = self.images.paths[index], self.images.lens
        if path is None:
            raise ImageError(
                f"frame {self.frame_names[index]}",
                expected="an image at the time of the scan",
                found="none near enough",
                advice=f"correct the time_offset_s of the camera; or {SKIP_ADVICE}",
            )
        image = read_image(path)
        if lens is None:
            return image
        if (image.shape[1], image.shape[0]) != lens.size_px:
            raise ImageError(
                path,
                expected="{}x{} pixels".format(*lens.size_px) + f" as {lens.source} says",
                found=f"{image.shape[1]}x{image.shape[0]}",
            )
        return lens.undistort(image)

    def frame_calibration(self, index: int, image: UInt8 | None = None) -> Calibration | None:
        """Return the calibration of the drive."""
        return self.calibration

    def stamp_s(self, index: int) -> float:
        """Return the time of a scan since the drive's first."""
        return (int(self.stamps_ns[index]) - self.origin_ns) / 1e9

    def world_SE3_velo(self, index: int) -> Float64 | None:
        """Return the (4, 4) pose of one frame, interpolated at the time of its scan."""
        if self.poses is None or self.body_SE3_velo is None:
            return None
        pose = self.poses.at(self.rows[index], int(self.stamps_ns[index]), 1 / self.sensor.rate_hz)
        return np.asarray(pose @ self.body_SE3_velo)

    def labels(self, index: int) -> Labels:
        """Return the labels of one frame; none where the file has no row of it."""
        return self._labels_by_number.get(self.frame_numbers[index], empty_labels())

    @cached_property
    def _labels_by_number(self) -> Mapping[int, Labels]:
        advice = "add a section camera to drive.yaml"
        return require_tracking_labels(self.root, self.label_file, self.calibration, advice)

    def point_truth(self, index: int) -> PointTruth | None:
        """Read the classes of the points, or None without them."""
        if self.point_labels is None:
            return None
        return read_point_truth(self.point_labels.paths[index], len(self._cloud(index)))

    def frame_files(self, index: int) -> tuple[Path, ...]:
        """Return scan, labels and image of a frame."""
        image = None if self.images is None else self.images.paths[index]
        return tuple(
            path for path in (self.scans.paths[index], self.label_file, image) if path is not None
        )

    def _cloud(self, index: int) -> Cloud:
        path = self.scans.paths[index]
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
