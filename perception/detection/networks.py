"""The networks that a configuration names, opened."""

from dataclasses import replace

from perception.detection.bev.detector import BevDetector
from perception.detection.config import DetectionConfig
from perception.detection.depthcn.detector import DepthCn
from perception.detection.detectors.modalities import SHIPPED_DETECTORS
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.fusion.rescoring import Fusion
from perception.detection.onnx_model import shipped_model
from perception.sensor import LidarModel
from perception.types import DETECTOR_MODALITIES, MODALITIES, DetectorModality, Method, Modality

SHIPPED_BEV = "bev_centers"
_DEFAULT: tuple[DetectorModality, ...] = ("rgb", "bev")


def chosen_detection(config: DetectionConfig, method: Method = "default") -> DetectionConfig:
    """Return a configuration that states its modalities and whether DepthCN runs, those of its method where it does not.

    Without a network of the bird's-eye view, the default is that of the thesis. A modality whose file is named is used.

    Args:
        config: Detection configuration.
        method: Method of a configuration that states none.
    """
    has_bev = config.bev_model is not None or shipped_model(SHIPPED_BEV).is_file()
    is_thesis = (config.method or method) == "thesis" or not has_bev
    modalities, enabled = config.modalities, config.depthcn.enabled
    if modalities is None:
        of_method = MODALITIES if is_thesis else _DEFAULT
        modalities = tuple(
            name
            for name in DETECTOR_MODALITIES
            if config.models[name] or (name in of_method and _is_shipped(name))
        )
    if enabled is None:
        enabled = is_thesis or config.depthcn.model is not None
    return replace(config, modalities=modalities, depthcn=replace(config.depthcn, enabled=enabled))


def _is_shipped(modality: DetectorModality) -> bool:
    name = SHIPPED_BEV if modality == "bev" else SHIPPED_DETECTORS[modality]
    return shipped_model(name).is_file()


def enabled_modalities(
    config: DetectionConfig, method: Method = "default"
) -> tuple[DetectorModality, ...]:
    """Return the modalities of a configuration, those of its method where it states none."""
    return chosen_detection(config, method).modalities or ()


def detectors_note(config: DetectionConfig, method: Method = "default") -> str:
    """Return which detectors run, and why, in one line."""
    chosen = chosen_detection(config, method)
    names = [*(chosen.modalities or ()), *(["DepthCN"] if chosen.depthcn.enabled else [])]
    if config.modalities is not None:
        why = "as asked"
    elif "bev" in names:
        why = "the default; trifuse study modalities measures others on a drive"
    else:
        why = f"method {config.method or method}"
    return f"detectors: {', '.join(names) or 'none'} ({why})"


def open_bev(config: DetectionConfig, sensor: LidarModel) -> BevDetector | None:
    """Open the detector of the bird's-eye view, for one thread; None where it is not among the modalities.

    Raises:
        ModelError: there is no such file, or it holds no such detector.
    """
    if "bev" not in enabled_modalities(config, "thesis"):
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
        if modality in enabled_modalities(config, "thesis")
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
