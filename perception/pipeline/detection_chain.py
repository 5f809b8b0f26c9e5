"""What a camera is needed for: maps, the detectors of three views and their fusion, DepthCN, vehicles.

Frames know nothing of each other here, except where vehicles are followed.
"""

from dataclasses import dataclass

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
from perception.maps.densify import DenseMaps, densify
from perception.maps.projection import project_frame
from perception.pipeline.clock import StageClock
from perception.sensor import LidarModel
from perception.types import MODALITIES, Detections, Frame, Modality


@dataclass(frozen=True)
class DetectionResult:
    """What the detectors make of one frame, None of those that did not look.

    Attributes:
        multimodal: of three views, fused.
        depthcn: of DepthCN.
    """

    multimodal: MultimodalOutput | None
    depthcn: Detections | None


EMPTY_DETECTION_RESULT = DetectionResult(None, None)


@dataclass(frozen=True)
class DetectionChain:
    """The detectors that look at every frame with a camera.

    Attributes:
        multimodal: looks at image, depth map and reflectance map; None where nothing of it is wanted.
        depthcn: looks at the maps; None where it is not wanted.
    """

    multimodal: MultimodalDetector | None
    depthcn: DepthCn | None

    def detect(self, frame: Frame, clock: StageClock) -> DetectionResult:
        """Let all of them look at a frame with a camera."""
        # They are made once, for all to look at.
        with clock.stage("maps"):
            dense = densify(project_frame(frame))
        return DetectionResult(
            self._detect_multimodal(frame, dense, clock), self._run_depthcn(frame, dense, clock)
        )

    def _detect_multimodal(
        self, frame: Frame, dense: DenseMaps, clock: StageClock
    ) -> MultimodalOutput | None:
        """Let the detectors of three views look, and fuse what they see."""
        if self.multimodal is None:
            return None
        if frame.image is None and self.multimodal.detectors.keys() == {"rgb"}:
            return None
        with clock.nested() as nested:
            multimodal = self.multimodal.detect(frame, dense)
            nested.extend(multimodal.spans)
        return multimodal

    def _run_depthcn(self, frame: Frame, dense: DenseMaps, clock: StageClock) -> Detections | None:
        """Let DepthCN look."""
        if self.depthcn is None:
            return None
        # Of a network that learned from other maps, DepthCN makes its own.
        is_same = self.depthcn.verifier.method == "default"
        with clock.stage("DepthCN"):
            return self.depthcn.verify_frame(frame, dense if is_same else None).detections


def load_detectors(config: DetectionConfig, sensor: LidarModel) -> DetectionChain:
    """Open the networks of a choice.

    Raises:
        ModelError: a file is missing, or does not hold the network that it was named for.
    """
    detectors = {
        modality: ModalityDetector(config.models[modality] or modality, threads=1, nms=config.nms)
        for modality in enabled_modalities(config)
    }
    return DetectionChain(
        multimodal=MultimodalDetector(detectors, _open_fusion(config)) if detectors else None,
        depthcn=_open_depthcn(config, sensor) if config.depthcn.enabled else None,
    )


def is_detection_enabled(config: DetectionConfig) -> bool:
    """Tell whether a choice asks for any detector."""
    return config.depthcn.enabled or len(enabled_modalities(config)) > 0


def enabled_modalities(config: DetectionConfig) -> tuple[Modality, ...]:
    """Return the modalities of a choice; left open, all whose network is there."""
    if config.modalities is not None:
        return config.modalities
    return tuple(
        modality
        for modality in MODALITIES
        if config.models[modality] or shipped_model(f"{modality}_compact").is_file()
    )


def _open_depthcn(config: DetectionConfig, sensor: LidarModel) -> DepthCn:
    return DepthCn(
        config.depthcn.model or "default",
        sensor,
        proposals=config.depthcn.proposals,
        nms=config.nms,
    )


def _open_fusion(config: DetectionConfig) -> DetectionFusion:
    """Open the network that weighs the detectors; without one, the best box of each place stays."""
    if config.fusion.model is None and not shipped_model("fusion_default").is_file():
        return NmsFusion(config.nms.max_iou)
    return Fusion(
        config.fusion.model or "default",
        max_iou=config.nms.max_iou,
        tri_boxes=config.fusion.tri_boxes,
    )
