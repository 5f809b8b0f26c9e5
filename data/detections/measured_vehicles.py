"""Detectors whose detections are located and tracked on the road, to measure vehicles as objects."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from data.derived.motion_labels import LabelledAround
from data.detections.config import LabelNoise, VehicleDetector
from data.labelled_drives import LabelledDrives
from data.nuscenes.results import SampleBoxes
from data.nuscenes.samples import read_samples
from data.nuscenes.task_tracks import tracked_boxes, tracked_scene
from data.recorded_drive import RecordedDrive
from perception.detection.config import NO_DETECTION, DetectionConfig
from perception.detection.depthcn.detector import DepthCn
from perception.detection.networks import (
    chosen_detection,
    open_bev,
    open_detectors,
    open_fusion,
)
from perception.detection.vehicles.config import VehicleConfig
from perception.detection.vehicles.locate import locate
from perception.errors import DriveError
from perception.evaluation.nuscenes.tracking import measure_task_tracks
from perception.evaluation.vehicle_measure import VehicleMeasure, VehicleReport
from perception.pipeline import PipelineConfig
from perception.tracking.vehicles.tracker import VehicleTracker
from perception.types import MODALITIES, Detections, Drive, Frame, FusedDetections, Result

# Types of labels that detectors of cars find.
_DETECTED = ("Car", "Van")
_LABEL_SCORE = 0.9


@dataclass(frozen=True)
class OpenedVehicleDetector:
    """A detector in place of that of the pipeline, or the pipeline's own.

    Attributes:
        detect: Function from a frame to detections; None for the pipeline's own detectors.
        metadata: Metadata of each network.
    """

    detect: Callable[[Frame], Detections] | None = None
    metadata: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    def pipeline(self, config: PipelineConfig) -> PipelineConfig:
        """Return the configuration of the pipeline, without its own detectors where this replaces them."""
        return config if self.detect is None else replace(config, detection=NO_DETECTION)

    def results(self, results: Iterable[Result], config: VehicleConfig) -> Iterator[Result]:
        """Yield results of that pipeline with the vehicles of this detector.

        Args:
            results: Results of consecutive frames.
            config: Location and tracking of vehicles.
        """
        tracker = VehicleTracker(config.tracker)
        for result in results:
            if self.detect is None:
                yield result
                continue
            found = self.detect(result.frame)
            found = found[np.argsort(-found.scores, kind="stable")]
            sources = np.full((len(found), len(MODALITIES)), -1)
            columns = np.full(len(found), MODALITIES.index("dm"))
            fused = FusedDetections(found, sources, columns, found.scores)
            located = locate(fused, result.frame, result.ground, config)
            tracked = tracker.update(located, result.frame, result.odom_SE3_velo, result.tracks)
            yield replace(result, vehicles=tracked.vehicles, tracks=tracked.tracks)


def open_vehicle_detector(
    name: VehicleDetector, drive: Drive, config: DetectionConfig, noise: LabelNoise
) -> OpenedVehicleDetector:
    """Open the detectors of the pipeline, DepthCN, or noisy labels, which show the error of location and tracking.

    Args:
        name: Name of the detector.
        drive: Labelled drive.
        config: Detectors of the pipeline.
        noise: Noise of the labels.

    Raises:
        ModelError: a model file cannot be used.
    """
    if name == "labels":
        return OpenedVehicleDetector(_label_detector(drive, noise))
    if name == "depthcn":
        detector = DepthCn("default", drive.sensor)
        return OpenedVehicleDetector(detector.detect, {"depthcn": detector.verifier.model.metadata})
    config = chosen_detection(config, drive.sensor)
    metadata = {str(key): one.metadata for key, one in open_detectors(config).items()}
    metadata["fusion default"] = open_fusion(config).metadata
    if (bev := open_bev(config, drive.sensor)) is not None:
        metadata["bev"] = bev.model.metadata
    return OpenedVehicleDetector(metadata=metadata)


def _label_detector(drive: Drive, noise: LabelNoise) -> Callable[[Frame], Detections]:
    """Return a detector whose detections are the noisy labels of a drive."""
    random = np.random.default_rng(noise.seed)

    def detect(frame: Frame) -> Detections:
        labels = drive.labels(frame.index)
        is_found = random.random(len(labels)) >= noise.missing
        boxes_px = labels.boxes_px[np.isin(labels.types, _DETECTED) & is_found]
        sizes_px = np.tile(boxes_px[:, 2:] - boxes_px[:, :2], 2)
        noise_px = noise.sides * sizes_px * random.standard_normal(boxes_px.shape)
        count = len(boxes_px)
        return Detections(boxes_px + noise_px, np.full(count, _LABEL_SCORE), np.full(count, "Car"))

    return detect


def measure_vehicles(
    drive: RecordedDrive,
    reader: LabelledDrives,
    opened: OpenedVehicleDetector,
    pipeline: PipelineConfig,
    display_score: float,
) -> VehicleReport:
    """Run the pipeline with a detector over a labelled drive, and measure its vehicles.

    Args:
        drive: Drive with labelled boxes that have track ids.
        reader: How its frames are read.
        opened: Detector.
        pipeline: Pipeline configuration.
        display_score: Existence of a vehicle from which on it counts, 0 to 1.

    Raises:
        DriveError: The drive has no labelled sequence.
    """
    if not (drive.is_sequence and drive.has_labels):
        raise DriveError(
            drive.root,
            expected="frames in order of time with labelled boxes that have track ids",
            found="single frames" if drive.has_labels else "no boxes",
            advice="name such a drive, or make one: trifuse synth OUT --layout tracking",
        )
    measure, tracked = VehicleMeasure(display_score), dict[int, SampleBoxes]()
    results = reader.results(drive, opened.pipeline(pipeline))
    for result in opened.results(results, pipeline.vehicles):
        index = result.frame.index
        around = drive.labels_around(index) if isinstance(drive, LabelledAround) else None
        measure.update(result, drive.labels(index), around)
        is_sample = around is not None and drive.sample_token(index) is not None
        if is_sample and result.vehicles is not None:
            tracked[index] = tracked_boxes(result.vehicles, drive.map_SE3_velo(index))
    report = measure.compute()
    if not tracked:
        return report
    pairs = zip(read_samples(drive, [*tracked]), tracked.values(), strict=True)
    return replace(report, task=measure_task_tracks([tracked_scene([*pairs])]))
