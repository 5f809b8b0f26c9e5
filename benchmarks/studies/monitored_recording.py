"""Frames of a drive in memory, and what the monitors of each part say of them, clean or with a fault."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from data.faults.injection import Fault, inject
from perception.geometry.grids import EgoVehicle
from perception.health.camera_monitors import CameraMonitors
from perception.health.ins_monitor import InsMonitor
from perception.health.miscalibration import MiscalibrationMonitor
from perception.health.monitors import ScanAndInsMonitors
from perception.health.scan_statistics import ScanMeter
from perception.localization.config import RegistrationConfig
from perception.localization.frame_registration import FrameRegistration
from perception.localization.registration import Registration
from perception.pipeline import Pipeline, PipelineConfig
from perception.sensor import LidarModel
from perception.types import (
    CALIBRATION,
    CAMERA,
    INS,
    LIDAR,
    Drive,
    Float64,
    Frame,
    HealthFinding,
)

WARM_UP = 15  # frames from which monitors learn what is usual


class _Monitor(Protocol):  # of one part
    def __call__(self, frame: Frame, pose: Float64, /) -> Sequence[HealthFinding]:
        """Return the findings of a frame with its registered pose."""


@dataclass(frozen=True)
class MonitoredRecording:
    """Frames of a drive in memory, with the poses that registration gives them.

    Attributes:
        name: Name of the drive.
        frames: Frames.
        poses: (4, 4) registered pose of each frame.
        sensor: LiDAR model.
    """

    name: str
    frames: Sequence[Frame]
    poses: Sequence[Float64]
    sensor: LidarModel

    @classmethod
    def of(cls, drive: Drive, limit: int, step: int = 1) -> "MonitoredRecording":
        """Read and register the first frames of a drive.

        Args:
            drive: Drive.
            limit: Number of frames; 0 for all.
            step: Step from one frame to the next.
        """
        registration = FrameRegistration()
        rows = range(0, len(drive), step)[: limit or None]
        frames = [replace(drive[row], index=index) for index, row in enumerate(rows)]
        poses = [registration.update(one) for one in frames]
        return cls(drive.name, frames, poses, drive.sensor)

    @property
    def parts(self) -> list[str]:
        """Parts of the vehicle whose monitors have something to measure."""
        first = self.frames[0]
        has_image = first.image is not None
        present = {
            LIDAR: True,
            CAMERA: has_image,
            INS: first.world_SE3_velo is not None,
            CALIBRATION: has_image and first.calibration is not None,
        }
        return [part for part, is_present in present.items() if is_present]

    def speed_m_s(self, row: int) -> float:
        """Return the speed of the vehicle up to a frame in metres per second."""
        step = np.linalg.norm(self.poses[row][:3, 3] - self.poses[row - 1][:3, 3])
        return float(step / (self.frames[row].stamp_s - self.frames[row - 1].stamp_s))

    def alarms(self) -> Iterator[str]:
        """Yield the beginning of each finding of the pipeline, without detectors, in the clean drive."""
        before = set[str]()
        with Pipeline(self.sensor, PipelineConfig.for_obstacles()) as pipeline:
            for frame in self.frames:
                found = pipeline.step(frame).health.findings
                yield from (
                    f"{self.name} frame {frame.index}: {one}"
                    for one in found
                    if one.fault not in before
                )
                before = {one.fault for one in found}

    def delay(self, fault: Fault, within: int) -> int | None:
        """Return after how many frames a fault is named, None where it is not in time."""
        first = max(0, fault.first - WARM_UP)
        part = slice(first, fault.first + within)
        monitor = self._monitor(fault.definition.part)
        injected = inject(self.frames[part], [fault])
        for frame, pose in zip(injected, self.poses[part], strict=True):
            found = monitor(frame, pose)
            is_named = any(one.fault in fault.definition.reported for one in found)
            if frame.index >= fault.first and is_named:
                return frame.index - fault.first
        return None

    @cached_property
    def _meter(self) -> ScanMeter:
        return ScanMeter(self.sensor)

    def _monitor(self, part: str) -> _Monitor:
        """Return the monitors of one part, at the beginning of a drive."""
        if part == CAMERA:
            camera = CameraMonitors()
            return lambda frame, _: camera.update(frame)
        if part == CALIBRATION:
            return MiscalibrationMonitor(self.sensor).update
        if part == INS:
            return _InsBesideScans().update
        scans = ScanAndInsMonitors(self._meter)
        return lambda frame, _: scans.update(frame).findings


class _InsBesideScans:
    """The monitor of the INS with registration as the pipeline has it: from the INS, but not from one that has failed."""

    def __init__(self) -> None:
        self._ins, self._ego = InsMonitor(), EgoVehicle()
        self._registration = Registration(RegistrationConfig(), "default", previous_scans=0)

    def update(self, frame: Frame, _: Float64) -> Sequence[HealthFinding]:
        found = self._ins.update(frame)
        used = replace(frame, world_SE3_velo=None) if found else frame
        scans = self._registration.update(used, self._ego.crop(frame.points_velo))
        is_trusted = not (scans.is_reset or scans.is_extrapolated)
        self._ins.register(frame, scans.window.newest.world_SE3_velo, is_trusted=is_trusted)
        return found
