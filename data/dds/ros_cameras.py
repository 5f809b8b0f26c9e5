"""Cameras of a robot: each is used from when its images, their CameraInfo and its transform are there."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

from data.bags.bag import Bag
from data.bags.drive import BagDrive, BagImages
from data.bags.message_times import read_times
from data.bags.opening import BagOpening, joined_images
from data.bags.topics import camera_info_of
from data.drive_images import DriveImages
from data.further_cameras import DriveCamera, FurtherCameras
from data.live.source_health import SourceHealth
from perception.errors import PerceptionError
from perception.types import Calibration, UInt8

_UNUSABLE, LEFT_OUT = "images not used", "image left out"


@dataclass(frozen=True)
class _CheckedImages(DriveImages):
    """Images of which those that cannot be used are left out, and reported."""

    images: BagImages
    health: SourceHealth

    def select(self, indices: Sequence[int]) -> Self:
        """Return the images of some frames."""
        return replace(self, images=self.images.select(indices))

    def read(self, index: int) -> UInt8 | None:
        """Read the (H, W, 3) image of a frame, or None where the frame has none that can be used."""
        topic = self.images.stream.topic
        try:
            image = self.images.read(index)
        except PerceptionError as error:
            self.health.report(topic, LEFT_OUT, str(error))
            return None
        if image is not None:
            self.health.clear([topic], LEFT_OUT)
        return image


@dataclass(frozen=True)
class _Camera:
    name: str
    images: BagImages
    calibration: Calibration


@dataclass
class RosCameras:
    """The cameras that were named, or the first one; the first that can be used is the main one.

    Attributes:
        names: Names in results by topic.
        health: Takes what is wrong with them.
    """

    names: dict[str, str]
    health: SourceHealth
    _opened: dict[str, _Camera] = field(default_factory=dict)

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics of the images that are used."""
        return tuple(self._opened)

    def open(self, opening: BagOpening, lidar_frame: str) -> None:
        """Use the cameras whose calibration is known.

        Args:
            opening: Opening of the scans.
            lidar_frame: Frame of reference of the LiDAR.
        """
        turn, bag = opening.lidar_SE3_velo(lidar_frame), opening.bag
        lidar = opening.topics.lidars[0]
        found = {}
        for topic, name in self.names.items():
            times = read_times(bag, (lidar, topic), {})
            chosen = replace(
                opening,
                topics=replace(
                    opening.topics, camera=topic, camera_info=camera_info_of(bag, topic)
                ),
                times={topic: times[topic].by_clock_of(times[lidar])},
                streams={},
            )
            try:
                found[topic] = _Camera(name, *chosen.camera(lidar_frame, turn))
            except PerceptionError as error:
                self.health.report(topic, _UNUSABLE, str(error))
            else:
                self.health.clear([topic], _UNUSABLE)
        self._opened = found

    def joined(self, drive: BagDrive, bag: Bag) -> BagDrive:
        """Return the drive with the images of a bag that are nearest to its scans."""
        cameras = list(self._joined(drive, bag))
        if not cameras:
            return replace(drive, images=None, calibration=None, further_cameras=FurtherCameras())
        main, *others = cameras
        return replace(
            drive,
            camera=main.name,
            images=main.images,
            calibration=main.calibration,
            further_cameras=FurtherCameras(tuple(others)),
        )

    def _joined(self, drive: BagDrive, bag: Bag) -> Iterator[DriveCamera]:
        lidar = drive.sweeps.lidars[0].stream.times
        for topic, one in self._opened.items():
            times = read_times(bag, (topic,), {})[topic]
            one.images.stream.move_to(bag, times.by_clock_of(lidar))
            images = joined_images(one.images, drive.stamps_ns)
            yield DriveCamera(one.name, one.calibration, _CheckedImages(images, self.health))
