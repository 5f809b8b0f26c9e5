"""`trifuse evaluate vehicles`."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from data.results.command_config import CommandConfig
from data.results.evaluated import EvaluatedDrive, EvaluationDocument
from perception.cli.evaluation import open_labelled_drive, publish_report
from perception.cli.flags import DriveFlags, LabelledDriveFlags, ReportFlags
from perception.detection.config import NO_DETECTION, DepthCnConfig, DetectionConfig
from perception.errors import DriveError
from perception.pipeline import PipelineConfig
from perception.types import MODALITIES, Detections, Drive, Frame, FusedDetections, Result

VehicleDetector = Literal["fused", "depthcn", "labels"]
Detector = Callable[[Frame], Detections]
_PIPELINE = PipelineConfig(detection=DetectionConfig(depthcn=DepthCnConfig(enabled=False)))
# Types of labels that detectors of cars find.
_DETECTED = ("Car", "Van")
_LABEL_SCORE = 0.9


@dataclass(frozen=True)
class LabelNoise:
    """Noise that makes labels look like detections.

    Attributes:
        sides: Standard deviation of each side, as a share of the box's width or height.
        missing: Share of the labels that are not detected, 0 to 1.
        seed: Seed of the noise and of the missing labels.
    """

    sides: float = 0.05
    missing: float = 0.1
    seed: int = 0


_NOISE = LabelNoise()


def evaluate_vehicles(
    root: Path,
    *,
    drive: LabelledDriveFlags,
    report: ReportFlags,
    config: CommandConfig,
    detector: VehicleDetector = "fused",
    display_score: float = DetectionConfig.display_score,
    noise: LabelNoise = _NOISE,
    pipeline: PipelineConfig = _PIPELINE,
) -> None:
    """Measure detected vehicles as objects: HOTA, MOTA and IDF1 in the image, and positions on the road.

    Example: trifuse evaluate vehicles kitti/tracking --sequence 0000 --detector depthcn

    Args:
        root: Sequences in KITTI's tracking layout, or a synthetic drive in it.
        detector: Detectors of the pipeline, DepthCN, or noisy labels, which show the error of location and tracking.
        display_score: Score of a vehicle from which on it counts, 0 to 1.
        noise: Noise of the labels with `--detector labels`.
        pipeline: Pipeline configuration.
    """
    from data.detections.unlearned_frames import count_learned_frames
    from data.kitti.sequence import KittiSequence
    from perception.detection.depthcn.detector import DepthCn
    from perception.evaluation.vehicle_measure import PROTOCOL_WORDS, VehicleMeasure

    labelled = open_labelled_drive(root, drive, images=detector == "fused")
    if not isinstance(labelled, KittiSequence) or labelled.label_file is None:
        raise DriveError(
            labelled.root,
            expected="labels with track ids, as in KITTI's tracking layout",
            found="none",
            advice="name a sequence in that layout, or make one: trifuse synth OUT --layout tracking",
        )
    detect: Detector | None = None
    if detector == "depthcn":
        detect = DepthCn("default", labelled.sensor).detect
    elif detector == "labels":
        detect = _label_detector(labelled, noise)
    measure = VehicleMeasure(display_score)
    for result in _results(labelled, drive, pipeline, detect):
        measure.update(result, labelled.labels(result.frame.index), None)
    metrics = measure.compute()
    data = EvaluatedDrive.of(labelled, drive.frames, metrics.frames)
    networks = _network_metadata(detector, pipeline.detection, labelled)
    document = EvaluationDocument.of_networks("vehicles", data, PROTOCOL_WORDS, networks)
    learned = count_learned_frames(networks, labelled.select(range(data.first_frames)))
    learned.warn(labelled.name)
    heading = f"{data}, detector {detector}, scores from {display_score:g}"
    if networks:
        heading = f"{heading}\n{learned}"
    publish_report(heading, metrics, document, config, report.json)


def _results(
    drive: Drive, flags: DriveFlags, pipeline: PipelineConfig, detect: Detector | None
) -> Iterator[Result]:
    """Yield the results of the pipeline, with its own vehicles or those of another detector."""
    from perception.cli.drive_results import drive_results
    from perception.detection.vehicles.locate import locate
    from perception.tracking.vehicles.tracker import VehicleTracker

    tracker = VehicleTracker(pipeline.vehicles.tracker)
    config = pipeline if detect is None else replace(pipeline, detection=NO_DETECTION)
    for result in drive_results(drive, config, limit=flags.frames, on_bad_frame=flags.on_bad_frame):
        if detect is None:
            yield result
            continue
        found = detect(result.frame)
        found = found[np.argsort(-found.scores, kind="stable")]
        sources = np.full((len(found), len(MODALITIES)), -1)
        fused = FusedDetections(found, sources, np.full(len(found), MODALITIES.index("dm")))
        located = locate(fused, result.frame, result.ground, pipeline.vehicles)
        tracked = tracker.update(located, result.frame, result.world_SE3_velo, result.tracks)
        yield replace(result, vehicles=tracked.vehicles, tracks=tracked.tracks)


def _network_metadata(
    detector: VehicleDetector, config: DetectionConfig, drive: Drive
) -> dict[str, Mapping[str, str]]:
    """Return the metadata of each network that detects."""
    from perception.detection.depthcn.detector import DepthCn
    from perception.detection.networks import open_detectors, open_fusion

    if detector == "labels":
        return {}
    if detector == "depthcn":
        return {"depthcn": DepthCn("default", drive.sensor).verifier.model.metadata}
    modalities = {str(name): one.metadata for name, one in open_detectors(config).items()}
    return {**modalities, "fusion default": open_fusion(config).metadata}


def _label_detector(drive: Drive, noise: LabelNoise) -> Detector:
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
