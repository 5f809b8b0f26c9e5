"""A drive through detection, location and tracking of vehicles, by one of several detectors."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from data.frames import OnBadFrame
from perception.cli.drive_results import drive_results
from perception.detection.config import DepthCnConfig, DetectionConfig
from perception.detection.depthcn.detector import DepthCn
from perception.detection.vehicles.locate import locate
from perception.pipeline import PipelineConfig
from perception.tracking.vehicles.tracker import VehicleTracker, VehicleTrackerResult
from perception.types import MODALITIES, Detections, Drive, Frame, FusedDetections, Result

VehicleSource = Literal["fused", "depthcn", "labels"]
# Of what labels call so, detectors of cars find most.
_DETECTED = ("Car", "Van")
_LABEL_SCORE = 0.9


@dataclass(frozen=True)
class LabelNoise:
    """What is done to labels so that they look like detections.

    Attributes:
        noise: standard deviation of each side, as a share of the box's width or height.
        missing: share of the labels that is not detected.
        seed: of both.
    """

    noise: float = 0.05
    missing: float = 0.1
    seed: int = 0


@dataclass(frozen=True)
class VehicleFrame:
    """What is known of the vehicles of one frame.

    Attributes:
        frame: with its scan.
        tracked: vehicles and moving objects.
    """

    frame: Frame
    tracked: VehicleTrackerResult


def vehicle_frames(
    drive: Drive,
    source: VehicleSource,
    label_noise: LabelNoise,
    *,
    limit: int | None,
    on_bad_frame: OnBadFrame,
) -> Iterator[VehicleFrame]:
    """Yield the followed vehicles of each frame.

    Args:
        drive: what is read.
        source: the pipeline's own detectors, DepthCN, or labels that are made noisy.
        label_noise: of these.
        limit: only so many frames from the start, or None.
        on_bad_frame: stop or skip.

    Raises:
        PerceptionError: a frame cannot be read or used.
    """
    if source == "fused":
        config = PipelineConfig(detection=DetectionConfig(depthcn=DepthCnConfig(enabled=False)))
        for result in drive_results(drive, config, limit=limit, on_bad_frame=on_bad_frame):
            if result.vehicles is not None:
                yield VehicleFrame(
                    result.frame, VehicleTrackerResult(result.vehicles, result.tracks)
                )
        return
    detect = _by_depthcn(drive) if source == "depthcn" else _by_labels(drive, label_noise)
    tracker, config = VehicleTracker(), PipelineConfig.for_motion()
    for result in drive_results(drive, config, limit=limit, on_bad_frame=on_bad_frame):
        yield VehicleFrame(result.frame, _track(tracker, detect(result.frame), result))


def _track(tracker: VehicleTracker, detections: Detections, result: Result) -> VehicleTrackerResult:
    best_first = np.argsort(-detections.scores, kind="stable")
    fused = FusedDetections(
        detections[best_first],
        np.full((len(detections), len(MODALITIES)), -1),
        np.full(len(detections), MODALITIES.index("dm")),
    )
    vehicles = locate(fused, result.frame, result.ground)
    return tracker.update(vehicles, result.frame, result.world_SE3_velo, result.tracks)


def _by_depthcn(drive: Drive) -> Callable[[Frame], Detections]:
    return DepthCn("default", drive.sensor).detect


def _by_labels(drive: Drive, label_noise: LabelNoise) -> Callable[[Frame], Detections]:
    random = np.random.default_rng(label_noise.seed)

    def read(frame: Frame) -> Detections:
        labels = drive.labels(frame.index)
        is_found = random.random(len(labels)) >= label_noise.missing
        boxes_px = labels.boxes_px[np.isin(labels.types, _DETECTED) & is_found]
        sizes_px = np.tile(boxes_px[:, 2:] - boxes_px[:, :2], 2)
        noise_px = label_noise.noise * sizes_px * random.standard_normal(boxes_px.shape)
        count = len(boxes_px)
        return Detections(boxes_px + noise_px, np.full(count, _LABEL_SCORE), np.full(count, "Car"))

    return read
