"""Fusion of detectors whose classes differ: each class by the detectors that know it.

    rgb  Car Cyclist
    dm   Car
    rm   Car

A network for cars fuses the cars of all three; the cyclists of rgb keep their scores.
"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.fusion.detected_scene import DetectedScene, rows_of_classes
from perception.detection.fusion.nms_fusion import NmsFusion
from perception.detection.fusion.rescoring import Fusion
from perception.types import MODALITIES, FusedDetections, Modality

log = logging.getLogger(__name__)


class DetectionFusion(Protocol):
    """Fuses the detections of several modalities."""

    def fuse(self, scene: DetectedScene) -> FusedDetections:
        """Return the fused detections, best first."""
        ...


@dataclass(frozen=True)
class ClassGroup:
    """Classes that the same detectors know.

    Attributes:
        class_names: Names of the classes.
        modalities: Modalities whose detectors know all of them.
        is_fused: Whether the fusion network knows them.
    """

    class_names: tuple[str, ...]
    modalities: tuple[Modality, ...]
    is_fused: bool


class ClassFusion:
    """Fuses each class by the detectors that know it; a `DetectionFusion`.

    Classes that the fusion network does not know keep the scores of their detectors, by non-maximum suppression.
    """

    def __init__(self, network: Fusion, groups: tuple[ClassGroup, ...]) -> None:
        """Combine a fusion network and the groups of classes."""
        self._network, self._groups = network, groups
        self._suppression = NmsFusion(network.max_iou)

    def fuse(self, scene: DetectedScene) -> FusedDetections:
        """Return the fused detections of all classes, best first."""
        fused = FusedDetections.concatenate(self._fuse_group(scene, one) for one in self._groups)
        return fused[np.argsort(-fused.detections.scores, kind="stable")]

    def _fuse_group(self, scene: DetectedScene, group: ClassGroup) -> FusedDetections:
        """Return the fused detections of some classes, with the rows that they come from in the whole scene."""
        others = set(MODALITIES) - set(group.modalities)
        part = scene.without(*others).of_classes(group.class_names)
        fused = (self._network if group.is_fused else self._suppression).fuse(part)
        source_indices = fused.source_indices.copy()
        for column, modality in enumerate(MODALITIES):
            if modality in part.modality_detections:
                found = scene.modality_detections[modality]
                rows = np.append(rows_of_classes(found, group.class_names), -1)
                source_indices[:, column] = rows[source_indices[:, column]]
        return replace(fused, source_indices=source_indices)


def fusion_of(network: Fusion, detectors: Mapping[Modality, ModalityDetector]) -> DetectionFusion:
    """Return the fusion of some detectors by a network, and log where it does not fit to them.

    A single detector that the network was not trained with keeps its scores: there is nothing to fuse.
    """
    # Scores of other detectors mean something else; a network without fingerprints fits to all.
    fitted = dict(
        pair.split(" ") for pair in network.metadata.get("detectors", "").split(", ") if " " in pair
    )
    unfitted = [
        one.model.name
        for name, one in detectors.items()
        if fitted.get(name, one.fingerprint) != one.fingerprint
    ]
    if len(detectors) == 1 and unfitted:
        (alone,) = detectors.values()
        names = ", ".join(alone.class_names)
        log.warning("%s detects %s alone: nothing is fused", alone.model.name, names)
        return NmsFusion(network.max_iou)
    if unfitted:
        log.warning(
            "%s was trained with other detectors than %s: its scores may be wrong; retrain it with "
            "`trifuse train fusion`",
            network.name,
            " and ".join(unfitted),
        )
    groups = class_groups(network.class_names, detectors)
    if len(groups) == 1 and groups[0].is_fused:
        return network
    log.warning("%s fuses %s", network.name, _in_words(groups))
    return ClassFusion(network, groups)


def class_groups(
    fused_names: tuple[str, ...], detectors: Mapping[Modality, ModalityDetector]
) -> tuple[ClassGroup, ...]:
    """Group all classes of some detectors by the detectors that know them, and whether they are fused."""
    names = dict.fromkeys(name for one in detectors.values() for name in one.class_names)
    groups: dict[tuple[tuple[Modality, ...], bool], list[str]] = {}
    for name in names:
        knowing = tuple(modality for modality, one in detectors.items() if name in one.class_names)
        groups.setdefault((knowing, name in fused_names), []).append(name)
    return tuple(ClassGroup(tuple(names), *key) for key, names in groups.items())


def _in_words(groups: tuple[ClassGroup, ...]) -> str:
    fused = [_group_in_words(one) for one in groups if one.is_fused]
    kept = [_group_in_words(one) for one in groups if not one.is_fused]
    words = " and ".join(fused) or "none of these classes"
    if kept:
        words += f"; {' and '.join(kept)} keep the scores of their detectors"
    return words


def _group_in_words(group: ClassGroup) -> str:
    return f"{', '.join(group.class_names)} of {', '.join(group.modalities)}"


def detector_fingerprints(detectors: Mapping[Modality, ModalityDetector]) -> str:
    """Return the fingerprints of detectors as in the metadata of a fusion: `rgb 0f3a..., dm ...`."""
    return ", ".join(f"{name} {one.fingerprint}" for name, one in sorted(detectors.items()))
