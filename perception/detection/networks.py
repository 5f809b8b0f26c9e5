"""The networks that a configuration names, opened."""

from perception.detection.config import DetectionConfig
from perception.detection.depthcn.detector import DepthCn
from perception.detection.detectors.modalities import SHIPPED_DETECTORS
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.fusion.rescoring import Fusion
from perception.detection.onnx_model import shipped_model
from perception.sensor import LidarModel
from perception.types import MODALITIES, Modality


def enabled_modalities(config: DetectionConfig) -> tuple[Modality, ...]:
    """Return the configured modalities; where none are given, all whose network is there."""
    if config.modalities is not None:
        return config.modalities
    return tuple(
        modality
        for modality in MODALITIES
        if config.models[modality] or shipped_model(SHIPPED_DETECTORS[modality]).is_file()
    )


def open_detectors(config: DetectionConfig) -> dict[Modality, ModalityDetector]:
    """Open the detectors of the configured modalities, for one thread each.

    Raises:
        ModelError: there is no such file, or it holds no detector.
    """
    return {
        modality: ModalityDetector(config.models[modality] or modality, threads=1, nms=config.nms)
        for modality in enabled_modalities(config)
    }


def open_fusion(config: DetectionConfig) -> Fusion:
    """Open the fusion network.

    Raises:
        ModelError: there is no such file, or it holds no fusion network.
    """
    return Fusion(
        config.fusion_model or "default", max_iou=config.nms.max_iou, tri_boxes=config.tri_boxes
    )


def open_depthcn(config: DetectionConfig, sensor: LidarModel) -> DepthCn:
    """Open DepthCN, for one thread: blocks of crops are too small to be shared.

    Raises:
        ModelError: there is no such file, or it holds no network of DepthCN.
    """
    depthcn = config.depthcn
    return DepthCn(
        depthcn.model or "default", sensor, proposals=depthcn.proposals, nms=config.nms, threads=1
    )
