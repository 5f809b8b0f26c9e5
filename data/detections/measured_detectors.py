"""Detectors with their networks open, to be measured on labelled drives: one modality, DepthCN, or the fusion of three."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from data.array_store import ArrayStore
from data.detections.cached_detections import FingerprintedDetector, detected_scene
from perception.detection.bev.detector import BevDetector
from perception.detection.config import DetectionConfig, FusionVariant
from perception.detection.depthcn.detector import DepthCn
from perception.detection.detectors.detector_description import YAML_SUFFIXES
from perception.detection.detectors.modalities import modality_image
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.detectors.multimodal import MultimodalDetector
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.detector_fusion import (
    DetectionFusion,
    detector_fingerprints,
    fusion_of,
)
from perception.detection.fusion.rescoring import Fusion
from perception.detection.networks import open_bev, open_depthcn, open_detectors, open_fusion
from perception.detection.vehicles.bev_joining import join_bev
from perception.detection.vehicles.bev_objects import bev_vehicles
from perception.detection.vehicles.locate import locate
from perception.errors import UsageError
from perception.evaluation.detection.box_rows import LocatedDetections
from perception.evaluation.detection.config import PrecisionConfig
from perception.evaluation.detection.detector_measure import DetectorMeasure, FrameDetections
from perception.evaluation.detection.fusion_measure import FusionMeasure, LocatedScene
from perception.evaluation.detection.protocol import KITTI_CLASSES, DetectionClass, kitti_class
from perception.localization.scan_window import PosedScan, ScanWindow
from perception.maps.densify import DenseMaps
from perception.maps.projection import camera_of
from perception.obstacles.ground import ground_estimator
from perception.pipeline import PipelineConfig
from perception.pipeline.workers import StageClock
from perception.sensor import HDL_64E, LidarModel
from perception.tracking.vehicles.fronts import FrontRecord, shape_odds, with_fronts
from perception.types import MODALITIES, Drive, Frame, GroundModel, Progress, UInt8

_THESIS_TABLE_7_9 = "Thesis, Table 7.9: AP R11 37.59 % (easy, IoU 0.7) on the 7518 test frames of KITTI's server; not comparable."
Detect = Callable[[Frame], Any]


@dataclass(frozen=True)
class SceneLocator:
    """Fuses the detections of single frames and fits their 3D boxes to the scan and the ground.

    Attributes:
        fusion: Fusion of the modalities.
        sensor: LiDAR model of the scans.
        config: Pipeline configuration.
        bev: Detector of the bird's-eye view, whose objects are joined; None without it.
    """

    fusion: DetectionFusion
    sensor: LidarModel
    config: PipelineConfig
    bev: BevDetector | None = None

    def locate(self, scene: DetectedScene, frame: Frame) -> LocatedScene:
        """Return the detections of a frame with those of the fusion located in its scan."""
        fused = self.fusion.fuse(scene)
        vehicles = locate(fused, frame, self._ground(frame), self.config.vehicles)
        if self.bev is not None:
            found = bev_vehicles(self.bev.detect(frame.points_velo), self.bev.class_names, frame)
            searched = {0: 1.0} if "rgb" in scene.modality_detections else {}
            joined = join_bev(vehicles, found, frame, searched)
            vehicles = joined.select(np.flatnonzero(joined.cameras == 0))
        odds = FrontRecord().odds(vehicles, shape_odds(vehicles, frame.points_velo))
        vehicles = with_fronts(vehicles, odds)
        located = LocatedDetections(vehicles.fused.detections, vehicles.boxes, camera_of(frame)[0])
        return LocatedScene(scene, located, has_bev=self.bev is not None)

    def _ground(self, frame: Frame) -> GroundModel:
        """Return the ground of a drive that starts with this frame."""
        config, points_velo = self.config, frame.points_velo
        window = ScanWindow(previous_scans=0)
        window.push(PosedScan(points_velo[~config.ego_vehicle.contains_xy(points_velo)], np.eye(4)))
        method, area = config.method_of(config.ground), config.area_of(self.sensor)
        estimator = ground_estimator(config.ground, method, self.sensor, area, config.seed)
        return estimator.update(window)


@dataclass(frozen=True)
class MeasuredDetector:
    """A detector with its networks open, to be measured on one drive after another.

    Attributes:
        title: Name of the detector in the report.
        metadata: Metadata of each network's file.
        classes: Classes that are measured.
        start: Returns what detects in the frames of a drive, and a new measure of it.
        image: Returns an (H, W, C) image on which detections are drawn.
    """

    title: str
    metadata: Mapping[str, Mapping[str, str]]
    classes: Sequence[DetectionClass]
    start: Callable[[Drive], tuple[Detect, Any]]
    image: Callable[[Frame], UInt8]


@dataclass(frozen=True)
class DetectorOptions:
    """Options of a measured detector.

    Attributes:
        config: Networks, proposals and suppression.
        classes: Names of the classes to measure; none for all of a network, those of KITTI's benchmark for the
            fusion.
        metric: Metric configuration.
        fusions: ONNX files of further fusion networks.
        cache: Folder for the detections of the modalities before fusion; else the user's cache folder.
        progress: Iterates over the bootstrap resamples and may show a progress bar.
    """

    config: DetectionConfig
    classes: Sequence[str]
    metric: PrecisionConfig
    fusions: Sequence[Path] = ()
    cache: Path | None = None
    progress: Progress = iter


def open_detector(name: str, options: DetectorOptions) -> MeasuredDetector:
    """Open a detector by its name: fusion, depthcn, rgb, dm, rm, or an ONNX file of a modality's detector.

    Raises:
        ModelError: a file holds no such network.
        UsageError: there is no such detector, or the network does not know a class.
    """
    modality = next((known for known in MODALITIES if known == name), None)
    if name == "fusion":
        return _fusion(options)
    if name == "depthcn":
        return _depthcn(options)
    if modality is None and not name.endswith((".onnx", *YAML_SUFFIXES)):
        expected = "fusion, depthcn, rgb, dm, rm, an ONNX file or a YAML file that describes one"
        raise UsageError("--detector", expected=expected, found=name)
    model = Path(name) if modality is None else options.config.models[modality] or modality
    return measured_network(ModalityDetector(model, nms=options.config.nms), options)


def measured_network(network: ModalityDetector, options: DetectorOptions) -> MeasuredDetector:
    """Return the detector of one modality, to be measured."""
    modality, size = network.modality, network.size
    detector = MultimodalDetector({modality: network}, workers=1)
    classes = _parse_classes(options.classes, network.class_names)

    def detect(frame: Frame) -> FrameDetections:
        output = detector.detect(frame)
        timings_s = {name: output.timings_s[name] for name in ("maps", modality)}
        return FrameDetections(output.scene.modality_detections[modality], timings_s)

    return MeasuredDetector(
        f"{network.title}: {modality}, {size}",
        {str(modality): dict(network.metadata)},
        classes,
        lambda _: (detect, _measure(f"average precision of {modality}", classes, options)),
        lambda frame: modality_image(frame, modality, network.filling),
    )


def _depthcn(options: DetectorOptions) -> MeasuredDetector:
    """Return DepthCN, which is opened for the sensor of each drive."""
    verifier = open_depthcn(options.config, HDL_64E).verifier
    classes = _parse_classes(options.classes, verifier.class_names)

    def start(drive: Drive) -> tuple[Detect, DetectorMeasure]:
        network = open_depthcn(options.config, drive.sensor)
        title, notes = "average precision of DepthCN", (_THESIS_TABLE_7_9,)
        return lambda frame: run_depthcn(network, frame)[0], _measure(
            title, classes, options, notes
        )

    metadata = {"depthcn": dict(verifier.model.metadata)}
    return MeasuredDetector("DepthCN", metadata, classes, start, _camera_image)


def _fusion(options: DetectorOptions) -> MeasuredDetector:
    """Return three detectors, whose detections are cached, and their fusions."""
    detector = open_modalities(options.config)
    networks = detector.detectors
    fusions = open_fusions(options.config, options.fusions, detector)
    detected = dict.fromkeys(name for one in networks.values() for name in one.class_names)
    known = [name for name in detected if all(name in one.class_names for one in fusions.values())]
    usual = [one.name for one in KITTI_CLASSES if one.name in known]
    classes = _parse_classes(options.classes or usual, known)
    names = {one.name for one in classes}
    blind = [key for key, one in networks.items() if names.isdisjoint(one.class_names)]
    fusion = fusion_of(fusions["default"], networks)
    # Everything besides the frames that the cached detections depend on.
    fingerprint = f"{detector_fingerprints(networks)} {options.config.nms}"
    cached = FingerprintedDetector(detector, fingerprint)
    store = ArrayStore(options.cache)

    def start(drive: Drive) -> tuple[Detect, FusionMeasure]:
        measure = FusionMeasure(classes, options.metric, options.progress, fusions=fusions)

        bev = open_bev(options.config, drive.sensor)
        locator = SceneLocator(fusion, drive.sensor, PipelineConfig(), bev)

        def detect(frame: Frame) -> LocatedScene:
            scene = detected_scene(drive, frame.index, cached, store)
            return locator.locate(scene.without(*blind), frame)

        return detect, measure

    metadata = {str(name): dict(one.metadata) for name, one in networks.items()}
    metadata |= {f"fusion {name}": dict(one.metadata) for name, one in fusions.items()}
    title = "Fusion of " + ", ".join(one.model.name for one in networks.values())
    return MeasuredDetector(title, metadata, classes, start, _camera_image)


def open_modalities(config: DetectionConfig) -> MultimodalDetector:
    """Open the detectors of the configured modalities, else of all.

    Raises:
        ModelError: a file holds no detector, or one of another modality.
    """
    return MultimodalDetector(open_detectors(config))


def open_fusions(
    config: DetectionConfig, further: Sequence[Path], detector: MultimodalDetector
) -> dict[FusionVariant, Fusion]:
    """Open the fusion network and further ones, by variant.

    Raises:
        ModelError: a file holds no fusion network.
    """
    opened = [Fusion(file, max_iou=config.nms.max_iou) for file in further]
    fusions: dict[FusionVariant, Fusion] = {one.variant: one for one in opened}
    fusions["default"] = open_fusion(config)
    for one in fusions.values():
        fusion_of(one, detector.detectors)  # logs where it does not fit
    return fusions


def run_depthcn(detector: DepthCn, frame: Frame) -> tuple[FrameDetections, DenseMaps]:
    """Detect in one frame and time each stage; return the dense maps of the scan, too."""
    calibration, _ = camera_of(frame)
    clock = StageClock()
    with clock.stage("proposals"):
        proposals = detector.propose(frame)
    with clock.stage("maps"):
        dense = detector.densify(frame)
    with clock.stage("verification"):
        detections = detector.verify(proposals, dense, calibration).detections
    return FrameDetections(detections, clock.seconds, proposals.boxes_px), dense


def _measure(
    title: str,
    classes: Sequence[DetectionClass],
    options: DetectorOptions,
    notes: Sequence[str] = (),
) -> DetectorMeasure:
    return DetectorMeasure(classes, options.metric, options.progress, title=title, notes=notes)


def _camera_image(frame: Frame) -> UInt8:
    """Return the camera image, or the depth map of a frame without one."""
    return modality_image(frame, "dm" if frame.image is None else "rgb")


def _parse_classes(names: Sequence[str], known: Sequence[str]) -> tuple[DetectionClass, ...]:
    """Return the classes of names in any case, or all that are known.

    Raises:
        UsageError: a name is not known.
    """
    by_name = {name.lower(): name for name in known}
    for name in names:
        if name.lower() not in by_name:
            raise UsageError("--classes", expected=", ".join(known), found=name)
    return tuple(kitti_class(by_name[name.lower()]) for name in names or known)
