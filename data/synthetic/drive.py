"""A synthetic drive in memory: frames are rendered on access, the same at every access."""

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Self

import numpy as np

from data.kitti.calibration import DriveCalibration
from data.kitti.oxts import InsPacket, Mercator
from data.synthetic import ins, labelling, lidar
from data.synthetic.camera import Camera
from data.synthetic.exposure import Exposure, draw_exposure
from data.synthetic.ins import InsNoise
from data.synthetic.lidar import LidarScan
from data.synthetic.light import draw_daylight
from data.synthetic.rig import camera_calibration, default_calibration
from data.synthetic.words import CameraName
from data.synthetic.world import World, build_world
from data.synthetic.world_config import WorldConfig
from perception.errors import DriveError, UsageError
from perception.geometry import se3
from perception.sensor import HDL_64E, LidarModel
from perception.types import Calibration, CameraImage, Float64, Frame, Labels, PointTruth, UInt8

_WORLD, _INS, _SCAN, _IMAGE = range(4)  # streams of random numbers


class SyntheticDrive:
    """Frames of a synthetic world, deterministic in seed and index; implements `perception.types.drive.Drive`."""

    is_sequence = True
    has_poses = True
    has_labels = True
    notes = ()
    _make: "partial[Self]"

    def __new__(cls, *args: Any, **kwargs: Any) -> Self:  # noqa: ANN401 - those of any drive
        """Remember the arguments, of which the drive can be made again."""
        drive = super().__new__(cls)
        drive._make = partial(cls, *args, **kwargs)
        return drive

    def __init__(  # noqa: PLR0913 - what a drive is made of
        self,
        frames: int = 80,
        *,
        seed: int = 0,
        sensor: LidarModel = HDL_64E,
        config: WorldConfig | None = None,
        noise: InsNoise | None = None,
        images: bool = True,
        cameras: Sequence[CameraName] = ("front",),
    ) -> None:
        """Draw the world.

        Args:
            frames: Number of scans.
            seed: Seed of the world and of all noise.
            sensor: LiDAR model.
            config: World configuration; else a street with dense traffic.
            noise: Noise of the INS; else that of KITTI's INS.
            images: Whether frames carry images.
            cameras: Cameras, the main one first; labels are of its image.
        """
        if frames < 1:
            raise UsageError("synthetic drive", expected="at least one frame", found=str(frames))
        self.name, self.root = f"synthetic_{seed:04d}", Path(f"synthetic_{seed:04d}")
        self.sensor, self.has_images = sensor, images
        if not cameras or len(set(cameras)) < len(cameras):
            found = ", ".join(cameras) or "none"
            raise UsageError("cameras", expected="at least one, each once", found=found)
        self.cameras = tuple(cameras)
        self.rig: DriveCalibration = replace(
            default_calibration(), camera=camera_calibration(self.cameras[0])
        )
        self._frames, self._seed, self._noise = frames, seed, noise or InsNoise()
        self.world: World = self._build_world(config or WorldConfig(), self._random(_WORLD))

    def _build_world(self, config: WorldConfig, rng: np.random.Generator) -> World:
        """Draw the world of the drive."""
        return build_world(config, self._frames / self.sensor.rate_hz, rng)

    def _random(self, stream: int, index: int = 0) -> np.random.Generator:
        return np.random.default_rng([self._seed, stream, index])

    @property
    def make(self) -> "partial[Self]":
        """Function that makes the same drive, as in another process, which ray casting scenes cannot be sent to."""
        return self._make

    @property
    def calibration(self) -> Calibration:
        """The camera's."""
        if self.rig.camera is None:
            raise DriveError(self.name, expected="a rig with a camera", found="none")
        return self.rig.camera

    def __len__(self) -> int:
        return self._frames

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> Frame:
        """Render one frame."""
        index = range(self._frames)[index]
        return Frame(
            index=index,
            stamp_s=self.stamp_s(index),
            points_velo=self.scan(index).points_velo,
            image=self.image(index) if self.has_images else None,
            world_SE3_velo=self.world_SE3_velo(index),
            calibration=self.calibration,
            source=f"{self.name} frame {index}",
            camera=self.cameras[0] if len(self.cameras) > 1 else Frame.camera,
            further_cameras=tuple(
                CameraImage(
                    name,
                    camera_calibration(name),
                    self.image(index, name) if self.has_images else None,
                )
                for name in self.cameras[1:]
            ),
        )

    def stamp_s(self, index: int) -> float:
        """Return when the LiDAR of a frame faces forward, which is when the camera opens."""
        return range(self._frames)[index] / self.sensor.rate_hz

    def scan(self, index: int) -> LidarScan:
        """Take the scan of one frame, with the truth of its points."""
        rng = self._random(_SCAN, range(self._frames)[index])
        return lidar.scan(self.world, self.sensor, self.stamp_s(index), rng)

    def image(self, index: int, camera: CameraName | None = None) -> UInt8:
        """Take the image of one frame, of the main camera where none is named."""
        index = range(self._frames)[index]
        number = 0 if camera is None else self.cameras.index(camera)
        rng = self._random(_IMAGE, index)
        if number:
            rng = np.random.default_rng([self._seed, _IMAGE, index, number])
        return self._cameras[number].take(
            self._poses[index], self.stamp_s(index), self._exposure(index), rng
        )

    @cached_property
    def _cameras(self) -> list[Camera]:
        rng = self._random(_IMAGE, self._frames)
        config = self.world.config
        daylight = draw_daylight(self.world.sun, config.is_sunny, rng, is_night=config.is_night)
        further = (camera_calibration(name) for name in self.cameras[1:])
        return [Camera(self.world, one, daylight) for one in (self.calibration, *further)]

    def _exposure(self, index: int) -> Exposure:
        """Return the exposure of one frame: the same throughout a drive, but for its metering."""
        is_night = self.world.config.is_night
        return draw_exposure(self._random(_IMAGE, self._frames + 1), is_night=is_night)

    def ins_packet(self, index: int) -> InsPacket:
        """Return the INS packet of one frame."""
        return self._packets[range(self._frames)[index]]

    def world_SE3_velo(self, index: int) -> Float64:
        """Return the (4, 4) pose by the INS, in metres around the first packet."""
        return self._metres.world_SE3_imu(self.ins_packet(index)) @ se3.inverse(self._velo_SE3_imu)

    def true_world_SE3_velo(self, index: int) -> Float64:
        """Return the exact (4, 4) pose, in the same world as those by the INS."""
        pose = self._poses[range(self._frames)[index]].copy()
        pose[:3, 3] -= ins.ORIGIN.world_SE3_imu(self._packets[0])[:3, 3]
        return np.asarray(pose)

    def labels(self, index: int, *, is_tracking: bool = True) -> Labels:
        """Label one frame by KITTI's rules, truncation as tracking's levels or as a share."""
        return labelling.label(
            self.world, self.calibration, self._poses[range(self._frames)[index]],
            self.stamp_s(index), is_tracking=is_tracking,
        )  # fmt: skip

    def labels_around(self, index: int, *, by_category: bool = False) -> Labels:
        """Return exact labels of all objects around, in the camera's view or not, by KITTI's classes or finer ones."""
        index = range(self._frames)[index]
        return labelling.label_around(
            self.world, self._poses[index], self.stamp_s(index), by_category=by_category
        )

    def point_truth(self, index: int) -> PointTruth:
        """Return the exact truth of every point of one frame."""
        return self.scan(index).truth

    @cached_property
    def _poses(self) -> Float64:
        """(F, 4, 4) true LiDAR poses in the coordinates of the world's geometry."""
        stamps = np.arange(self._frames) / self.sensor.rate_hz
        return lidar.velo_poses(self.world, self.sensor, stamps)

    @property
    def _velo_SE3_imu(self) -> Float64:
        if self.rig.velo_SE3_imu is None:
            raise DriveError(self.name, expected="a rig with an INS", found="none")
        return self.rig.velo_SE3_imu

    @cached_property
    def _packets(self) -> list[InsPacket]:
        poses = self._poses @ self._velo_SE3_imu
        return ins.packets(poses, self.sensor.rate_hz, self._noise, self._random(_INS))

    @cached_property
    def _metres(self) -> Mercator:
        return Mercator.around(self._packets[0])


class CachedDrive(SyntheticDrive):
    """A `SyntheticDrive` without images that keeps its scans: 4 MB each of an HDL-64E."""

    def __init__(
        self,
        frames: int = 80,
        *,
        seed: int = 0,
        sensor: LidarModel = HDL_64E,
        noise: InsNoise | None = None,
    ) -> None:
        """Draw the world.

        Args:
            frames: Number of scans.
            seed: Seed of the world and of all noise.
            sensor: LiDAR model.
            noise: Noise of the INS; else that of KITTI's INS.
        """
        super().__init__(frames, seed=seed, sensor=sensor, noise=noise, images=False)
        self._scans: dict[int, LidarScan] = {}

    def scan(self, index: int) -> LidarScan:
        """Return the scan of one frame, casting its rays at the first call only."""
        index = range(len(self))[index]
        if index not in self._scans:
            self._scans[index] = super().scan(index)
        return self._scans[index]

    def with_ins(self, noise: InsNoise) -> Self:
        """Return the same drive with another INS; world and scans, which do not depend on it, are shared."""
        other = copy(self)
        other._noise = noise
        for drawn in ("_packets", "_metres"):
            other.__dict__.pop(drawn, None)
        return other
