"""Detectors that commands open and measure: one modality, DepthCN, or the fusion of three modalities."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from data.array_store import ArrayStore
from data.detections.cached_detections import (
    FingerprintedDetector,
    detected_scene,
    models_fingerprint,
)
from perception.cli.progress import progress_bar
from perception.detection.config import (
    DepthCnConfig,
    DetectionConfig,
    FusionVariant,
    NmsConfig,
)
from perception.detection.depthcn.detector import DepthCn
from perception.detection.detectors.modalities import modality_image
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.detectors.multimodal import MultimodalDetector
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.detector_fingerprints import warn_of_detector_mismatch
from perception.detection.fusion.rescoring import Fusion
from perception.detection.onnx_model import shipped_model
from perception.errors import UsageError
from perception.evaluation.detection.config import PrecisionConfig
from perception.evaluation.detection.detector_measure import DetectorMeasure, FrameDetections
from perception.evaluation.detection.fusion_measure import FusionMeasure
from perception.evaluation.detection.protocol import DetectionClass, kitti_class
from perception.maps.densify import DenseMaps
from perception.maps.projection import camera_of
from perception.pipeline.workers import StageClock
from perception.sensor import HDL_64E, LidarModel
from perception.types import MODALITIES, Detections, Drive, Float64, Frame, Modality, UInt8

_THESIS_TABLE_7_9 = "Thesis, Table 7.9: AP R11 37.59 % (easy, IoU 0.7) on the 7518 test frames of KITTI's server; not comparable."
Detect = Callable[[Frame], Any]


@dataclass(frozen=True)
class OpenedDetector:
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


def open_detector(
    name: str, config: DetectionConfig, classes: Sequence[str], metric: PrecisionConfig
) -> OpenedDetector:
    """Open DepthCN or the detector of one modality.

    Args:
        name: Name, one of depthcn, rgb, dm, rm, or an ONNX file of a modality's detector.
        config: Networks, proposals and suppression.
        classes: Classes to measure; none for all of the network.
        metric: Metric configuration.

    Raises:
        ModelError: a file holds no such network.
        UsageError: there is no such detector, or the network does not know a class.
    """
    if name == "depthcn":
        return _measured_depthcn(config, classes, metric)
    modality = next((known for known in MODALITIES if known == name), None)
    if modality is None and not name.endswith(".onnx"):
        expected = "fusion, depthcn, rgb, dm, rm or an ONNX file"
        raise UsageError("--detector", expected=expected, found=name)
    model = Path(name) if modality is None else config.models[modality] or modality
    return measured_network(ModalityDetector(model, nms=config.nms), classes, metric)


def measured_network(
    network: ModalityDetector, classes: Sequence[str], metric: PrecisionConfig
) -> OpenedDetector:
    """Return the detector of one modality, to be measured.

    Args:
        network: Detector of one modality.
        classes: Classes to measure; none for all of the network.
        metric: Metric configuration.
    """
    modality, size = network.modality, network.size
    detector = MultimodalDetector({modality: network}, workers=1)
    known = _parse_classes(classes, network.class_names)

    def detect(frame: Frame) -> FrameDetections:
        output = detector.detect(frame)
        timings_s = {name: output.timings_s[name] for name in ("maps", modality)}
        return FrameDetections(output.modality_detections[modality], timings_s)

    def start(drive: Drive) -> tuple[Detect, DetectorMeasure]:
        del drive  # the network is the same for all
        title = f"average precision of {modality}"
        return detect, DetectorMeasure(known, metric, _progress(), title=title)

    return OpenedDetector(
        f"{network.model.name}: {modality}, {size.height_px}x{size.width_px}",
        {str(modality): dict(network.metadata)},
        known,
        start,
        lambda frame: modality_image(frame, modality, network.filling),
    )


def _measured_depthcn(
    config: DetectionConfig, classes: Sequence[str], metric: PrecisionConfig
) -> OpenedDetector:
    """Return DepthCN, to be measured; it is opened for the sensor of each drive."""
    known = _parse_classes(classes, ("Car",))
    model = open_depthcn(config.depthcn, config.nms, HDL_64E).verifier.model

    def start(drive: Drive) -> tuple[Detect, DetectorMeasure]:
        network = open_depthcn(config.depthcn, config.nms, drive.sensor)
        title, notes = "average precision of DepthCN", (_THESIS_TABLE_7_9,)

        def detect(frame: Frame) -> FrameDetections:
            output = run_depthcn(network, frame)
            return FrameDetections(output.detections, output.timings_s, output.proposals_px)

        return detect, DetectorMeasure(known, metric, _progress(), title=title, notes=notes)

    return OpenedDetector("DepthCN", {"depthcn": dict(model.metadata)}, known, start, _camera_image)


def open_fusion(
    config: DetectionConfig,
    classes: Sequence[str],
    metric: PrecisionConfig,
    further: Sequence[Path] = (),
    cache: Path | None = None,
) -> OpenedDetector:
    """Open three detectors, whose detections are cached, and their fusions.

    Args:
        config: Networks and suppression.
        classes: Class to measure; none for Car.
        metric: Metric configuration.
        further: ONNX files of further fusion networks.
        cache: Folder for the detections; else the user's cache folder.

    Raises:
        ModelError: a file holds no such network.
        UsageError: there are several classes, or the networks do not know it.
    """
    detector = open_modalities(config)
    networks = detector.detectors
    known = _parse_classes(classes or ("Car",), next(iter(networks.values())).class_names)
    if len(known) != 1:
        expected = "one class with --detector fusion"
        raise UsageError("--classes", expected=expected, found=",".join(classes))
    fusions = open_fusions(config, further, detector)
    cached, store = FingerprintedDetector(detector, _fingerprint(config)), ArrayStore(cache)

    def start(drive: Drive) -> tuple[Detect, FusionMeasure]:
        def detect(frame: Frame) -> DetectedScene:
            return detected_scene(drive, frame.index, cached, store)

        return detect, FusionMeasure(known, metric, _progress(), fusions=fusions)

    metadata = {str(name): dict(one.metadata) for name, one in networks.items()}
    metadata |= {f"fusion {name}": dict(one.metadata) for name, one in fusions.items()}
    title = "Fusion of " + ", ".join(one.model.name for one in networks.values())
    return OpenedDetector(title, metadata, known, start, _camera_image)


def open_modalities(config: DetectionConfig) -> MultimodalDetector:
    """Open the detectors of all modalities.

    Raises:
        ModelError: a file holds no detector, or one of another modality or other classes.
    """
    return MultimodalDetector(
        {
            name: ModalityDetector(config.models[name] or name, threads=1, nms=config.nms)
            for name in _modalities(config)
        }
    )


def open_fusions(
    config: DetectionConfig, further: Sequence[Path], detector: MultimodalDetector
) -> dict[FusionVariant, Fusion]:
    """Open the fusion network and further ones, by variant.

    Raises:
        ModelError: a file holds no fusion network.
    """
    overlap, fusion = config.nms.max_iou, config.fusion
    opened = [Fusion(file, max_iou=overlap) for file in further]
    fusions: dict[FusionVariant, Fusion] = {one.variant: one for one in opened}
    fusions["default"] = Fusion(
        fusion.model or "default", max_iou=overlap, tri_boxes=fusion.tri_boxes
    )
    for one in fusions.values():
        warn_of_detector_mismatch(one, detector.detectors)
    return fusions


@dataclass(frozen=True)
class DepthCnOutput:
    """Output of DepthCN for one frame.

    Attributes:
        dense: Dense maps of the scan.
        proposals_px: (P, 4) boxes before verification.
        detections: Vehicles, best first.
        timings_s: Time of each stage.
    """

    dense: DenseMaps
    proposals_px: Float64
    detections: Detections
    timings_s: Mapping[str, float]


def open_depthcn(config: DepthCnConfig, nms: NmsConfig, sensor: LidarModel) -> DepthCn:
    """Open DepthCN.

    Raises:
        ModelError: the file holds no network of DepthCN.
    """
    return DepthCn(config.model or "default", sensor, proposals=config.proposals, nms=nms)


def run_depthcn(detector: DepthCn, frame: Frame) -> DepthCnOutput:
    """Detect in one frame, and time each stage.

    Raises:
        CalibrationError: the frame has no camera to project to.
    """
    calibration, _ = camera_of(frame)
    clock = StageClock()
    with clock.stage("proposals"):
        proposals = detector.propose(frame)
    with clock.stage("maps"):
        dense = detector.densify(frame)
    with clock.stage("verification"):
        detections = detector.verify(proposals, dense, calibration).detections
    return DepthCnOutput(dense, proposals.boxes_px, detections, clock.seconds)


def _camera_image(frame: Frame) -> UInt8:
    """Return the camera image, or the depth map of a frame without one."""
    return modality_image(frame, "dm" if frame.image is None else "rgb")


def _modalities(config: DetectionConfig) -> tuple[Modality, ...]:
    return config.modalities or MODALITIES


def _fingerprint(config: DetectionConfig) -> str:
    """Return a hash of everything besides the frames that the cached detections depend on."""
    files = {
        name: config.models[name] or shipped_model(f"{name}_compact")
        for name in _modalities(config)
    }
    contents = {name: file.read_bytes() for name, file in files.items()}
    return f"{models_fingerprint(contents)} {config.nms}"


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


def _progress() -> Callable[[Any], Any]:
    return partial(progress_bar, description="bootstrap", unit="resample", delay_s=2)
