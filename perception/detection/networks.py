"""The networks that a configuration names, opened."""

from dataclasses import replace

from perception.detection.bev.detector import BevDetector
from perception.detection.config import DetectionConfig
from perception.detection.depthcn.detector import DepthCn
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.fusion.rescoring import Fusion
from perception.detection.onnx_model import shipped_model
from perception.sensor import LidarModel
from perception.types import DETECTOR_MODALITIES, MODALITIES, DetectorModality, Method, Modality

SHIPPED_BEV = "bev_centers"
_SPARSE: tuple[DetectorModality, ...] = ("rgb", "bev")


def chosen_detection(
    config: DetectionConfig, sensor: LidarModel, method: Method = "default"
) -> DetectionConfig:
    """Return a configuration that states its modalities and whether DepthCN runs, even where it left that open.

    The thesis' method detects in rgb, dm and rm and by DepthCN; the default in rgb and bev, but in rgb, dm and rm where
    the sensor is as dense as the one that these learned from. A modality whose file is named is used in any case.

    Args:
        config: Detection configuration.
        sensor: LiDAR model of the drive.
        method: Method of a configuration that states none.
    """
    is_thesis = (config.method or method) == "thesis"
    modalities, enabled = config.modalities, config.depthcn.enabled
    if modalities is None:
        usual = MODALITIES if is_thesis or sensor.is_dense else _SPARSE
        modalities = tuple(
            name for name in DETECTOR_MODALITIES if config.models[name] or name in usual
        )
    if enabled is None:
        enabled = is_thesis or config.depthcn.model is not None
    return replace(config, modalities=modalities, depthcn=replace(config.depthcn, enabled=enabled))


def detectors_note(config: DetectionConfig, sensor: LidarModel, method: Method = "default") -> str:
    """Return which detectors run, and why, in one line."""
    chosen = chosen_detection(config, sensor, method)
    names = [*(chosen.modalities or ()), *(["DepthCN"] if chosen.depthcn.enabled else [])]
    why = "as asked" if config.modalities is not None else f"method {config.method or method}"
    if why == "method default":
        why = f"the default of {sensor.beams} beams; trifuse study modalities measures others"
    return f"detectors: {', '.join(names) or 'none'} ({why})"


def open_bev(config: DetectionConfig, sensor: LidarModel) -> BevDetector | None:
    """Open the detector of the bird's-eye view, for one thread; None where it is not among the modalities.

    Raises:
        ModelError: there is no such file, or it holds no such detector.
    """
    if "bev" not in (config.modalities or ()):
        return None
    return BevDetector(config.bev_model or shipped_model(SHIPPED_BEV), sensor, threads=1)


def open_detectors(config: DetectionConfig) -> dict[Modality, ModalityDetector]:
    """Open the detectors of the configured modalities in an image, else of the thesis', for one thread each.

    Raises:
        ModelError: there is no such file, or it holds no detector.
    """
    return {
        modality: ModalityDetector(config.models[modality] or modality, threads=1, nms=config.nms)
        for modality in MODALITIES
        if modality in (MODALITIES if config.modalities is None else config.modalities)
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
