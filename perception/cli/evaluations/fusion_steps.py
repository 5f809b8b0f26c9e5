"""A labelled drive through the three detectors once, and through every way to make one list of what they saw."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

from perception.cli.evaluations.labelled_drives import DetectedDrive
from perception.cli.training.fusion_data import DetectorModelPaths
from perception.detection.config import FusionVariant
from perception.detection.detectors.multimodal import MultimodalDetector
from perception.detection.detectors.nms_fusion import NmsFusion
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.detector_fingerprints import warn_of_detector_mismatch
from perception.detection.fusion.rescoring import Fusion
from perception.detection.onnx_model import shipped_model
from perception.types import MODALITIES, Detections, Modality

# As Table 7.10 names them.
MODALITY_NAMES: Mapping[Modality, str] = {"rgb": "color", "dm": "depth", "rm": "reflectance"}
VARIANT_NAMES: Mapping[FusionVariant, str] = {
    "scores": "fusion on scores",
    "features": "fusion on all features",
    "default": "fusion, ours",
}
UNION_NAME = "merged, best box of a place"
STEP_NAMES = ("merged", "rescored", "rescored and suppressed")

Fuse = Callable[[DetectedScene], Detections]


@dataclass(frozen=True)
class FusionFiles(DetectorModelPaths):
    """Networks in the place of those that ship.

    Attributes:
        rgb: detector of the camera's image; an ONNX file, as are all.
        dm: detector of the depth map.
        rm: detector of the reflectance map.
        scores: fusion on scores.
        features: fusion on all features.
        default: fusion that knows distances, overlaps and what is missing.
    """

    scores: Path | None = None
    features: Path | None = None
    default: Path | None = None

    def open_detectors(self) -> MultimodalDetector:
        """Open the three detectors.

        Raises:
            ModelError: a file holds no detector, or one of another modality or other classes.
        """
        return MultimodalDetector(self.open())

    def open_fusions(self, detector: MultimodalDetector) -> dict[FusionVariant, Fusion]:
        """Open the networks that rescore what a detector sees: all that are named or ship.

        Raises:
            ModelError: a file holds no such network.
        """
        files: dict[FusionVariant, Path | None] = {
            "scores": self.scores,
            "features": self.features,
            "default": self.default,
        }
        fusions = {
            name: Fusion(file or name)
            for name, file in files.items()
            if file is not None or name == "default" or shipped_model(f"fusion_{name}").is_file()
        }
        for one in fusions.values():
            warn_of_detector_mismatch(one, detector.detectors)
        return fusions


def modalities_of(detected: DetectedDrive[DetectedScene]) -> tuple[Modality, ...]:
    """Return the modalities that all frames of a drive have."""
    return tuple(
        name
        for name in MODALITIES
        if all(name in scene.modality_detections for scene in detected.outputs)
    )


def table_rows(
    detected: DetectedDrive[DetectedScene], fusions: Mapping[FusionVariant, Fusion]
) -> Iterator[tuple[str, Sequence[Detections]]]:
    """Yield the rows of Table 7.10: each modality by itself, all of them merged, and each fusion."""
    for modality in modalities_of(detected):
        yield (
            MODALITY_NAMES[modality],
            [scene.modality_detections[modality] for scene in detected.outputs],
        )
    yield UNION_NAME, _of_all(detected, merge)
    for variant, fusion in fusions.items():
        yield VARIANT_NAMES[variant], _of_all(detected, fuse_with(fusion))


def missing_modality_rows(
    detected: DetectedDrive[DetectedScene], fusion: Fusion
) -> Iterator[tuple[tuple[Modality, ...], Sequence[Detections]]]:
    """Yield what a fusion makes of what is left where modalities are lost, the most of them first."""
    known = modalities_of(detected)
    for count in range(len(known) - 1, 0, -1):
        for remaining in combinations(known, count):
            lost = tuple(name for name in MODALITIES if name not in remaining)
            scenes = [scene.without(*lost) for scene in detected.outputs]
            yield remaining, [fuse_with(fusion)(scene) for scene in scenes]


def step_rows(
    detected: DetectedDrive[DetectedScene], fusion: Fusion
) -> Iterator[tuple[str, Sequence[Detections]]]:
    """Yield all boxes before rescoring, after it, and after suppression (Fig. 7.14)."""
    steps: tuple[Fuse, ...] = (
        lambda scene: scene.merged.detections,
        lambda scene: _rescored(fusion, scene),
        fuse_with(fusion),
    )
    for name, step in zip(STEP_NAMES, steps, strict=True):
        yield name, _of_all(detected, step)


def merge(scene: DetectedScene) -> Detections:
    """Return the best box of each place, whichever modality it is of."""
    return NmsFusion().fuse(scene.modality_detections, scene.size_px).detections


def fuse_with(fusion: Fusion) -> Fuse:
    """Return what a fusion does to a scene."""
    return lambda scene: fusion.fuse_scene(scene).detections


def _rescored(fusion: Fusion, scene: DetectedScene) -> Detections:
    if not len(scene.merged.detections):
        return Detections.empty()
    return fusion.rescore(scene).detections


def _of_all(detected: DetectedDrive[DetectedScene], fuse: Fuse) -> Sequence[Detections]:
    return [fuse(scene) for scene in detected.outputs]
