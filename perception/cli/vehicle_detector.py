"""A vehicle detector over a drive, with a clock on each of its parts."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeVar

from data.frames import OnBadFrame, frame_count, read_frames
from perception.cli.progress import progress_bar
from perception.detection.config import NmsConfig, ProposalConfig
from perception.detection.depthcn.detector import DepthCn
from perception.geometry.threads import limit_blas_threads
from perception.maps.densify import DenseMaps
from perception.maps.projection import camera_of
from perception.pipeline import StageClock
from perception.sensor import LidarModel
from perception.types import Detections, Drive, Float64, Frame, Method

Output = TypeVar("Output")


@dataclass(frozen=True)
class VehicleDetectorOutput:
    """What a detector makes of one frame.

    Attributes:
        frame: what it was given.
        dense: the maps that it looked at.
        proposals_px: (P, 4) boxes before verification.
        detections: after it.
        timings_s: by stage, in the order in which the stages ran.
    """

    frame: Frame
    dense: DenseMaps
    proposals_px: Float64
    detections: Detections
    timings_s: Mapping[str, float]


class VehicleDetector(Protocol):
    """Finds vehicles in one frame after the other; frames know nothing of each other."""

    @property
    def metadata(self) -> Mapping[str, str]:
        """What the file of the network says of it."""
        ...

    def detect(self, frame: Frame) -> VehicleDetectorOutput:
        """Detect in one frame.

        Raises:
            CalibrationError: the frame has no camera to project to.
        """
        ...


class TimedDepthCn:
    """DepthCN, part by part; implements `VehicleDetector`."""

    def __init__(self, detector: DepthCn) -> None:
        self._detector = detector

    @property
    def metadata(self) -> Mapping[str, str]:
        """What the file of the network says of it."""
        return self._detector.verifier.model.metadata

    def detect(self, frame: Frame) -> VehicleDetectorOutput:
        """Detect in one frame.

        Raises:
            CalibrationError: the frame has no camera to project to.
        """
        calibration, _ = camera_of(frame)
        clock = StageClock()
        with clock.stage("proposals"):
            proposals = self._detector.propose(frame)
        with clock.stage("maps"):
            dense = self._detector.densify(frame)
        with clock.stage("verification"):
            detections = self._detector.verify(proposals, dense, calibration).detections
        return VehicleDetectorOutput(frame, dense, proposals.boxes_px, detections, clock.seconds)


@dataclass(frozen=True)
class DepthCnConfig:
    """Which detector, and how it decides.

    Attributes:
        method: default, or thesis, of which model has to name a file.
        model: file of another network, or None.
        rules: how proposals are found; else as the network's method does.
        min_score: of a detection.
    """

    method: Method = "default"
    model: Path | None = None
    rules: ProposalConfig | None = None
    min_score: float = NmsConfig.min_score

    def open(self, sensor: LidarModel) -> VehicleDetector:
        """Open the network.

        Raises:
            ModelError: the file does not hold a network of this detector.
            UsageError: a rule cannot work.
        """
        detector = DepthCn(
            self.model or self.method,
            sensor,
            proposals=self.rules,
            nms=NmsConfig(min_score=self.min_score),
        )
        return TimedDepthCn(detector)


def detect_frames(
    drive: Drive, detector: VehicleDetector, *, limit: int | None, on_bad_frame: OnBadFrame
) -> Iterator[VehicleDetectorOutput]:
    """Yield what a detector makes of each frame of a drive, as `looks` does."""
    for _, output in outputs(drive, detector.detect, limit=limit, on_bad_frame=on_bad_frame):
        yield output


def outputs(
    drive: Drive, detect: Callable[[Frame], Output], *, limit: int | None, on_bad_frame: OnBadFrame
) -> Iterator[tuple[Frame, Output]]:
    """Yield each frame of a drive and what is made of it, with a progress bar.

    Args:
        drive: what is read.
        detect: what is made of a frame.
        limit: only so many frames from the start, or None.
        on_bad_frame: stop or skip.

    Raises:
        PerceptionError: a frame cannot be read or used.
    """
    frames = read_frames(drive, on_bad_frame=on_bad_frame, limit=limit)
    for frame in progress_bar(frames, drive.name, frame_count(drive, limit)):
        with limit_blas_threads():
            output = detect(frame)
        yield frame, output
