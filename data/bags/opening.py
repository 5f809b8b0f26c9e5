"""Open a bag as a drive: choose topics, read the times of their messages, join them to the scans."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from data.bags.bag import Bag, RawMessage
from data.bags.drive import BagDrive, BagImages
from data.bags.images import read_lens
from data.bags.ins_poses import (
    NavigationPoses,
    OdometryPoses,
    PoseSource,
    has_orientation,
    is_precise,
)
from data.bags.message_stream import MessageStream
from data.bags.message_times import MessageTimes, read_times
from data.bags.sensor import find_sensor
from data.bags.sweeps import BagLidar, SweepReader
from data.bags.topics import BagTopics, choose_topics
from data.bags.transforms import TransformTree
from data.layouts import OpenConfig
from data.nearest_time import half_period_s, nearest_in_time
from data.per_frame import FrameTuple
from data.reflectance import full_scale, largest_reflectance, sample_indices, scale_note
from perception.errors import CalibrationError, DriveError
from perception.geometry.se3 import from_rotation_translation, inverse
from perception.sensor import LidarModel
from perception.types import Calibration, Float64, Int

# Frames of vehicles with x forward, y left, z up (REP 105), the usual names first.
_BASES = ("base_link", "base_footprint", "base", "vehicle", "ego_vehicle", "vehicle_link", "car")
_ON_THE_ROAD = "base_footprint"
_MAX_TF_MESSAGES = (
    2_000  # a minute of moving frames; fixed ones are stated in /tf_static, or again and again
)
_SMALL = 1e-9


def open_bag(path: Path, config: OpenConfig) -> BagDrive:
    """Open a bag.

    Raises:
        DriveError: It is damaged, or has no scans.
        CalibrationError: A camera or LiDAR that was named has no transform to the others.
        MissingDependencyError: rosbags is not installed.
        UsageError: A topic that was named is not there.
    """
    return BagOpening.of(Bag(path), config).drive()


@dataclass
class BagOpening:
    """What is known while a bag is opened.

    Attributes:
        bag: Bag.
        config: How it is read.
        topics: Topics of the drive.
        times: Times of their messages.
        tree: Transforms.
        notes: Sentences on what was chosen or left out.
        streams: Messages of each topic that is used, by its name.
    """

    bag: Bag
    config: OpenConfig
    topics: BagTopics
    times: dict[str, MessageTimes]
    tree: TransformTree
    notes: list[str] = field(default_factory=list)
    streams: dict[str, MessageStream] = field(default_factory=dict)

    @classmethod
    def of(cls, bag: Bag, config: OpenConfig) -> "BagOpening":
        """Read the bag once."""
        topics = choose_topics(bag, config.lidar, config.camera, config.odometry)
        tree = TransformTree(str(bag.path))
        counts = dict.fromkeys(topics.transforms, 0)

        def add_transforms(message: RawMessage) -> None:
            counts[message.topic] += 1
            if counts[message.topic] <= _MAX_TF_MESSAGES:
                tree.add(bag.decode(message))

        times = read_times(bag, topics.timed, dict.fromkeys(topics.transforms, add_transforms))
        return cls(bag, config, topics, by_one_clock(times, topics), tree, list(topics.notes))

    def drive(self) -> BagDrive:
        """Return the drive."""
        streams = [self._stream(topic) for topic in self.topics.lidars]
        stamps_ns = streams[0].times.stamps_ns
        frames = [str(stream.read(0).header.frame_id) for stream in streams]
        lidar_SE3_velo = self.lidar_SE3_velo(frames[0])
        lidars = self._lidars(streams, frames, inverse(lidar_SE3_velo))
        images, calibration = self._camera_if_any(frames[0], lidar_SE3_velo)
        poses, ins_SE3_lidar = self._poses(frames[0])
        repeated = int(np.count_nonzero(np.diff(stamps_ns) == 0))
        if repeated:
            self.notes.insert(
                len(self.topics.notes),
                f"{self.bag.path}: {repeated} scans are left out, as their stamps are those of others",
            )
        sensor = self._sensor(lidars[0], frames[0], np.unique(stamps_ns))
        drive = BagDrive(
            name=self.bag.path.stem,
            root=self.bag.path,
            sensor=sensor,
            calibration=calibration,
            notes=tuple(self.notes),
            sweeps=SweepReader(lidars, np.zeros((0, len(lidars)), np.int64)),
            stamps_ns=stamps_ns,
            images=images if self.config.images else None,
            poses=poses,
            ins_SE3_velo=ins_SE3_lidar @ lidar_SE3_velo,
            frames=FrameTuple(),
        )
        return self.joined(drive)

    def joined(self, drive: BagDrive) -> BagDrive:
        """Return the drive with a frame for each scan, joined to the messages that are nearest in time."""
        lidars, images = drive.sweeps.lidars, drive.images
        stamps_ns, order = np.unique(lidars[0].stream.times.stamps_ns, return_index=True)
        rows = np.array([_rows(stamps_ns, one.stream) for one in lidars], np.int64).T.copy()
        rows[:, 0] = order
        return replace(
            drive,
            sweeps=SweepReader(lidars, rows),
            stamps_ns=stamps_ns,
            images=joined_images(images, stamps_ns) if isinstance(images, BagImages) else images,
            frames=FrameTuple(range(len(stamps_ns))),
        )

    def move_to(self, bag: Bag) -> None:
        """Read other messages of the same topics from now on, with all that was found out so far."""
        times = by_one_clock(read_times(bag, self.topics.timed, {}), self.topics)
        for topic, stream in self.streams.items():
            stream.move_to(bag, times[topic])

    def _stream(self, topic: str) -> MessageStream:
        times = self.times[topic]
        if not len(times):
            raise DriveError(self.bag.path, expected=f"messages of {topic}", found="none")
        return self.streams.setdefault(topic, MessageStream(self.bag, topic, times))

    def lidar_SE3_velo(self, lidar: str) -> Float64:
        """Return the turn from the vehicle's axes to those of the LiDAR: identity where the bag does not state it."""
        for base in _BASES:
            base_SE3_lidar = self.tree.find(base, lidar) if base != lidar else None
            if base_SE3_lidar is None:
                continue
            turn = base_SE3_lidar[:3, :3].T
            if np.abs(turn - np.eye(3)).max() < _SMALL:
                return np.eye(4)
            self.notes.append(
                f"{self.bag.path}: points of {lidar} are turned to the axes of {base}"
            )
            return from_rotation_translation(turn, np.zeros(3))
        return np.eye(4)

    def _lidars(
        self, streams: list[MessageStream], frames: list[str], velo_SE3_lidar: Float64
    ) -> list[BagLidar]:
        lidars = []
        for stream, frame in zip(streams, frames, strict=True):
            pose = velo_SE3_lidar
            if frame != frames[0]:
                purpose = f"to merge the scans of {stream.topic}"
                pose = velo_SE3_lidar @ self.tree.require(frames[0], frame, purpose)
            lidar = BagLidar(stream, pose)
            lidars.append(replace(lidar, full_scale=self._full_scale(lidar)))
        return lidars

    def _full_scale(self, lidar: BagLidar) -> float:
        if self.config.reflectance_scale is not None:
            return self.config.reflectance_scale
        clouds = [lidar.cloud(index) for index in sample_indices(len(lidar.stream))]
        values = [cloud.intensity for cloud in clouds if cloud.intensity is not None]
        largest = largest_reflectance(np.repeat(one[:, None], 4, axis=1) for one in values)
        scale = full_scale(largest)
        if scale != 1:
            self.notes.append(scale_note(f"{self.bag.path} {lidar.stream.topic}", largest, scale))
        return scale

    def _camera_if_any(
        self, lidar: str, lidar_SE3_velo: Float64
    ) -> tuple[BagImages | None, Calibration | None]:
        """Return the camera and its calibration; None where none was named, and none can be used."""
        if self.topics.camera is None:
            return None, None
        try:
            return self.camera(lidar, lidar_SE3_velo)
        except CalibrationError as error:
            if self.config.camera is not None:
                raise
            self.notes.append(f"images are not used: {error}")
            return None, None

    def camera(self, lidar: str, lidar_SE3_velo: Float64) -> tuple[BagImages, Calibration]:
        """Return the camera and its calibration.

        Args:
            lidar: Frame of reference of the LiDAR.
            lidar_SE3_velo: (4, 4) turn from the vehicle's axes to those of the LiDAR.

        Raises:
            CalibrationError: The bag does not state it.
            DriveError: There are no images.
        """
        topic, info = str(self.topics.camera), self.topics.camera_info
        stream = self._stream(topic)
        if info is None:
            raise CalibrationError(
                f"{self.bag.path} {topic}", expected="a topic camera_info beside it", found="none"
            )
        message = self.bag.decode(next(self.bag.messages((info,))))
        lens = read_lens(message, topic, f"{self.bag.path} {info}")
        cam_SE3_lidar = self.tree.require(
            message.header.frame_id, lidar, f"to use the images of {topic}"
        )
        turn = np.eye(3) if lens.is_pinhole or lens.rectification is None else lens.rectification
        calibration = Calibration(
            image_P_cam=np.column_stack([lens.pinhole_matrix, np.zeros(3)]),
            cam_SE3_velo=from_rotation_translation(turn, np.zeros(3))
            @ cam_SE3_lidar
            @ lidar_SE3_velo,
            image_size_px=lens.size_px,
            source=f"{self.bag.path} {info}",
        )
        return BagImages(stream, lens, FrameTuple()), calibration

    def _poses(self, lidar: str) -> tuple[PoseSource | None, Float64]:
        """Return the poses, and the transform from the LiDAR to their frame; None where they cannot be used."""
        topics = self.topics
        if topics.odometry is not None:
            stream = self._stream(topics.odometry)
            frame = stream.read(0).child_frame_id
            found: PoseSource | None = OdometryPoses(stream)
        elif topics.fixes is not None and topics.imu is not None:
            imu, fixes = self._stream(topics.imu), self._stream(topics.fixes)
            frame = imu.read(0).header.frame_id
            found = self._navigation(fixes, imu)
        else:
            return None, np.eye(4)
        ins_SE3_lidar = np.eye(4) if frame == lidar else self.tree.find(frame, lidar)
        if found is not None and ins_SE3_lidar is None:
            self.notes.append(
                f"{self.bag.path}: poses of {frame or 'an unnamed frame'} are not used, as no transform from {lidar} to it "
                "is in /tf_static or /tf"
            )
            found = None
        return found, np.eye(4) if ins_SE3_lidar is None else ins_SE3_lidar

    def _navigation(self, fixes: MessageStream, imu: MessageStream) -> PoseSource | None:
        first, attitude = fixes.read(0), imu.read(0)
        reason = None
        if not has_orientation(attitude):
            reason = f"{imu.topic} states no orientation"
        elif not is_precise(first):
            reason = f"{fixes.topic} states a deviation of more than 0.5 m"
        if reason is not None:
            self.notes.append(f"{self.bag.path}: positions are not used for poses, as {reason}")
            return None
        imu_SE3_antenna = self.tree.find(attitude.header.frame_id, first.header.frame_id)
        antenna_m = np.zeros(3) if imu_SE3_antenna is None else imu_SE3_antenna[:3, 3]
        return NavigationPoses(fixes, imu, antenna_m)

    def _sensor(self, lidar: BagLidar, frame: str, stamps_ns: Int) -> LidarModel:
        period_s = 2 * half_period_s((stamps_ns - stamps_ns[0]) / 1e9)
        rate_hz = 1 / period_s if np.isfinite(period_s) else None
        base_SE3_lidar = self.tree.find(_ON_THE_ROAD, frame)
        height_m = None if base_SE3_lidar is None else float(base_SE3_lidar[2, 3])
        if height_m is not None and height_m <= 0:
            height_m = None
        found = find_sensor(self.bag.path, lidar, self.config, rate_hz, height_m)
        self.notes.extend(found.notes)
        return found.model


def by_one_clock(times: Mapping[str, MessageTimes], topics: BagTopics) -> dict[str, MessageTimes]:
    """Return the times of all topics by the clock of the first LiDAR."""
    lidar = times[topics.lidars[0]]
    return {name: one.by_clock_of(lidar) for name, one in times.items()}


def joined_images(images: BagImages, stamps_ns: Int) -> BagImages:
    """Return images joined to the scans of (F,) stamps that they are nearest to in time."""
    return replace(images, rows=FrameTuple(_rows(stamps_ns, images.stream).tolist()))


def _rows(stamps_ns: Int, stream: MessageStream) -> Int:
    """Return the message that is nearest to each scan, as far as half the slower period."""
    stamps_s = (stamps_ns - stamps_ns[0]) / 1e9
    others_s = (stream.times.stamps_ns - stamps_ns[0]) / 1e9
    periods_s = [half for half in map(half_period_s, (stamps_s, others_s)) if np.isfinite(half)]
    # A little more, as stamps jitter.
    return nearest_in_time(stamps_s, others_s, 1.1 * max(periods_s, default=np.inf))
