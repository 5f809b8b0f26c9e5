"""The networks that a configuration names, opened."""

from perception.detection.bev.detector import BevDetector
from perception.detection.config import DetectionConfig
from perception.detection.depthcn.detector import DepthCn
from perception.detection.detectors.modalities import SHIPPED_DETECTORS
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.fusion.rescoring import Fusion
from perception.detection.onnx_model import shipped_model
from perception.sensor import LidarModel
from perception.types import MODALITIES, DetectorModality, Modality

SHIPPED_BEV = "bev_centers"


def enabled_modalities(config: DetectionConfig) -> tuple[DetectorModality, ...]:
    """Return the configured modalities; where none are given, all in an image whose network is there."""
    if config.modalities is not None:
        return config.modalities
    return tuple(
        modality
        for modality in MODALITIES
        if config.models[modality] or shipped_model(SHIPPED_DETECTORS[modality]).is_file()
    )


def open_bev(config: DetectionConfig, sensor: LidarModel) -> BevDetector | None:
    """Open the detector of the bird's-eye view, for one thread; None where it is not among the modalities.

    Raises:
        ModelError: there is no such file, or it holds no such detector.
    """
    if "bev" not in enabled_modalities(config):
        return None
    return BevDetector(config.bev_model or shipped_model(SHIPPED_BEV), sensor, threads=1)


def open_detectors(config: DetectionConfig) -> dict[Modality, ModalityDetector]:
    """Open the detectors of the configured modalities in an image, for one thread each.

    Raises:
        ModelError: there is no such file, or it holds no detector.
    """
    return {
        modality: ModalityDetector(config.models[modality] or modality, threads=1, nms=config.nms)
        for modality in MODALITIES
        if modality in enabled_modalities(config)
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
