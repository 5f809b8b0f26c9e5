"""The fusion of given detectors: by a network where it fits to them."""

import logging
from collections.abc import Mapping
from typing import Protocol

from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.nms_fusion import NmsFusion
from perception.detection.fusion.rescoring import Fusion
from perception.types import FusedDetections, Modality

log = logging.getLogger(__name__)


class DetectionFusion(Protocol):
    """Fuses the detections of several modalities."""

    def fuse(self, scene: DetectedScene) -> FusedDetections:
        """Return the fused detections, best first."""
        ...


def fusion_of(network: Fusion, detectors: Mapping[Modality, ModalityDetector]) -> DetectionFusion:
    """Return the fusion of some detectors by a network, and log where it does not fit to them.

    A single detector that the network was not trained with keeps its scores: there is nothing to fuse.
    """
    # Scores of other detectors mean something else; a network without fingerprints fits to all.
    fitted = dict(
        pair.split(" ") for pair in network.metadata.get("detectors", "").split(", ") if " " in pair
    )
    unfitted = [
        one.title
        for name, one in detectors.items()
        if fitted.get(name, one.fingerprint) != one.fingerprint
    ]
    if len(detectors) == 1 and unfitted:
        (alone,) = detectors.values()
        names = ", ".join(alone.class_names)
        log.warning("%s detects %s alone: nothing is fused", alone.title, names)
        return NmsFusion(network.max_iou)
    if unfitted:
        log.warning(
            "%s was trained with other detectors than %s: its scores may be wrong; retrain it with "
            "`trifuse train fusion`",
            network.name,
            " and ".join(unfitted),
        )
    detected = dict.fromkeys(name for one in detectors.values() for name in one.class_names)
    unknown = [name for name in detected if name not in network.class_names]
    if unknown and (unfitted or not fitted):
        log.warning(
            "%s was not trained with %s, which keep the scores of their detectors",
            network.name,
            ", ".join(unknown),
        )
    return network


def detector_fingerprints(detectors: Mapping[Modality, ModalityDetector]) -> str:
    """Return the fingerprints of detectors as in the metadata of a fusion: `rgb 0f3a..., dm ...`."""
    return ", ".join(f"{name} {one.fingerprint}" for name, one in sorted(detectors.items()))
