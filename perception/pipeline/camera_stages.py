"""The stages that need a camera: dense maps, detectors of three modalities and their fusion, DepthCN, vehicles."""

import logging
from dataclasses import replace

from perception.detection.config import DetectionConfig
from perception.detection.depthcn.detector import DepthCn
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.detectors.multimodal import (
    DetectionFusion,
    MultimodalDetector,
    MultimodalOutput,
)
from perception.detection.detectors.nms_fusion import NmsFusion
from perception.detection.fusion.rescoring import Fusion
from perception.detection.onnx_model import shipped_model
from perception.detection.vehicles.config import VehicleConfig
from perception.detection.vehicles.locate import locate
from perception.errors import CalibrationError
from perception.maps.densify import DenseMaps, densify
from perception.maps.projection import camera_of, project_frame
from perception.pipeline.stages import LidarResult
from perception.pipeline.workers import StageClock
from perception.sensor import LidarModel
from perception.tracking.vehicles.tracker import VehicleTracker, VehicleTrackerResult
from perception.types import MODALITIES, Detections, Frame, Modality, Result

log = logging.getLogger(__name__)


class CameraStages:
    """Runs the camera stages; only the vehicle tracker remembers earlier frames."""

    def __init__(
        self, sensor: LidarModel, detection: DetectionConfig, vehicles: VehicleConfig
    ) -> None:
        """Open the networks.

        Args:
            sensor: LiDAR model of the scans.
            detection: Detection configuration.
            vehicles: Configuration of location and tracking.

        Raises:
            ModelError: a file is missing, or does not hold the network that it is given for.
        """
        self._detectors = _open_detectors(detection)
        self._depthcn = _open_depthcn(detection, sensor) if detection.depthcn.enabled else None
        self._vehicles = vehicles
        self._has_warned = False
        self.reset()

    def reset(self) -> None:
        """Forget the vehicles of the drive so far."""
        self._tracker = VehicleTracker(self._vehicles.tracker)

    def can_detect(self, frame: Frame) -> bool:
        """Tell whether a detector runs and the frame has a camera; warn once where it has none."""
        if self._detectors is None and self._depthcn is None:
            return False
        try:
            camera_of(frame)
        except CalibrationError as error:
            if not self._has_warned:
                log.warning("no vehicles are detected: %s", error)
            self._has_warned = True
            return False
        return True

    def maps(self, frame: Frame) -> DenseMaps:
        """Return the dense maps, which are made once for all detectors."""
        return densify(project_frame(frame))

    def detect(
        self, frame: Frame, maps: DenseMaps | None, clock: StageClock
    ) -> MultimodalOutput | None:
        """Return the detections of three modalities and their fusion; None where they are off or lack an image."""
        detectors = self._detectors
        if maps is None or detectors is None:
            return None
        if frame.image is None and detectors.detectors.keys() == {"rgb"}:
            return None
        with clock.nested() as spans:
            multimodal = detectors.detect(frame, maps)
            spans.extend(multimodal.spans)
        return multimodal

    def detect_by_depthcn(
        self, frame: Frame, maps: DenseMaps | None, clock: StageClock
    ) -> Detections | None:
        """Return the detections of DepthCN; None where it is off."""
        if maps is None or self._depthcn is None:
            return None
        # A network that was trained on maps of another method makes its own.
        is_same = self._depthcn.verifier.method == "default"
        return clock.run(
            "DepthCN", self._depthcn.verify_frame, frame, maps if is_same else None
        ).detections

    def locate_and_track(
        self,
        frame: Frame,
        detections: MultimodalOutput | None,
        lidar: LidarResult,
        clock: StageClock,
    ) -> VehicleTrackerResult | None:
        """Return the detections as tracked vehicles on the road."""
        if lidar.is_reset:
            self._tracker.clear()
        if detections is None:
            return None
        with clock.stage("vehicles"):
            located = locate(detections.fused, frame, lidar.ground, self._vehicles)
            return self._tracker.update(located, frame, lidar.world_SE3_velo, lidar.tracks)

    def result(
        self,
        frame: Frame,
        lidar: LidarResult,
        detections: MultimodalOutput | None,
        vehicles: VehicleTrackerResult | None,
        depthcn: Detections | None,
        clock: StageClock,
    ) -> Result:
        """Join the results of all stages."""
        result = lidar.of_frame(frame)
        if detections is not None and vehicles is not None:
            result = replace(
                result,
                modality_detections=detections.modality_detections,
                map_images=detections.map_images,
                vehicles=vehicles.vehicles,
                tracks=vehicles.tracks,
            )
        return replace(
            result,
            depthcn=depthcn,
            timings_s=result.timings_s | clock.seconds,
            spans=lidar.spans + clock.spans,
        )


def is_detection_enabled(config: DetectionConfig) -> bool:
    """Tell whether any detector is configured to run."""
    return config.depthcn.enabled or len(enabled_modalities(config)) > 0


def enabled_modalities(config: DetectionConfig) -> tuple[Modality, ...]:
    """Return the configured modalities; where none are given, all whose network is there."""
    if config.modalities is not None:
        return config.modalities
    return tuple(
        modality
        for modality in MODALITIES
        if config.models[modality] or shipped_model(f"{modality}_compact").is_file()
    )


def _open_detectors(config: DetectionConfig) -> MultimodalDetector | None:
    detectors = {
        modality: ModalityDetector(config.models[modality] or modality, threads=1, nms=config.nms)
        for modality in enabled_modalities(config)
    }
    return MultimodalDetector(detectors, _open_fusion(config)) if detectors else None


def _open_depthcn(config: DetectionConfig, sensor: LidarModel) -> DepthCn:
    return DepthCn(
        config.depthcn.model or "default",
        sensor,
        proposals=config.depthcn.proposals,
        nms=config.nms,
    )


def _open_fusion(config: DetectionConfig) -> DetectionFusion:
    """Open the fusion network; without one, non-maximum suppression over all modalities."""
    if config.fusion.model is None and not shipped_model("fusion_default").is_file():
        return NmsFusion(config.nms.max_iou)
    return Fusion(
        config.fusion.model or "default",
        max_iou=config.nms.max_iou,
        tri_boxes=config.fusion.tri_boxes,
    )
