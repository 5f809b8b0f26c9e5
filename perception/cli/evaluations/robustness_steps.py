"""A labelled drive through the detectors at every level of every disturbance."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from data.corruptions import darken, drop_points, rotate_calibration, shift_calibration
from perception.cli.evaluations.fusion_steps import (
    MODALITY_NAMES,
    UNION_NAME,
    VARIANT_NAMES,
    merge,
)
from perception.cli.evaluations.labelled_drives import DetectedDrive
from perception.detection.detectors.multimodal import MultimodalDetector
from perception.detection.fusion.detected_scene import DetectedScene, scene_of
from perception.detection.fusion.rescoring import Fusion
from perception.errors import UsageError
from perception.maps.projection import camera_of
from perception.types import MODALITIES, Detections, Frame, Modality

_BY_LIDAR: tuple[Modality, ...] = ("dm", "rm")


@dataclass(frozen=True)
class Corruption:
    """Something that goes wrong, more or less.

    Attributes:
        name: with its unit.
        corrupt: returns a frame at a level.
        modalities: which see other pictures for it.
        levels: rising, above 0.
    """

    name: str
    corrupt: Callable[[Frame, float, np.random.Generator], Frame]
    modalities: tuple[Modality, ...]
    levels: tuple[float, ...]

    def __post_init__(self) -> None:
        """Refuse levels that do not rise from above 0."""
        if not self.levels or (np.diff(self.levels, prepend=0) <= 0).any():
            found = ", ".join(f"{level:g}" for level in self.levels) or "none"
            raise UsageError(self.name, expected="levels that rise from above 0", found=found)


@dataclass(frozen=True)
class CorruptionLevels:
    """At which levels each disturbance is measured, besides 0; none leaves it out.

    Attributes:
        darkness: of the camera, in stops: each halves the light.
        rays: share of the LiDAR's returns that are lost.
        degrees: by which the calibration is turned.
        pixels: by which the maps are shifted in the image.
    """

    darkness: tuple[float, ...] = (1, 2, 3, 4, 5, 6)
    rays: tuple[float, ...] = (0.25, 0.5, 0.75, 0.9)
    degrees: tuple[float, ...] = (0.25, 0.5, 1, 2)
    pixels: tuple[float, ...] = (2, 4, 8, 16)

    def corruptions(self, *, has_images: bool) -> tuple[Corruption, ...]:
        """Return what is measured of a drive with images or without.

        Raises:
            UsageError: levels do not rise from above 0, or there is none.
        """
        known = (
            (
                "darkness of the camera [stops]",
                darken,
                ("rgb",),
                self.darkness if has_images else (),
            ),
            ("LiDAR rays lost [share]", drop_points, _BY_LIDAR, self.rays),
            ("calibration turned [degrees]", rotate_calibration, _BY_LIDAR, self.degrees),
            ("calibration shifted [pixels]", shift_calibration, _BY_LIDAR, self.pixels),
        )
        found = tuple(Corruption(*of_one) for of_one in known if of_one[-1])
        if not found:
            raise UsageError("levels", expected="some of at least one disturbance", found="none")
        return found


# The scene of a frame as it is, and by disturbance and level.
CorruptedScenes = Mapping[tuple[str, float], DetectedScene]
CLEAN = ("", 0.0)


class CorruptedDetector:
    """Looks at a frame as it is and at every level; only detectors that see something else look again."""

    def __init__(
        self, detector: MultimodalDetector, disturbances: Sequence[Corruption], seed: int
    ) -> None:
        self._detector, self._seed = detector, seed
        self._corruptions = disturbances
        known = detector.detectors
        self._affected = {
            one.name: MultimodalDetector({name: known[name] for name in one.modalities})
            for one in disturbances
        }

    def detect(self, frame: Frame) -> CorruptedScenes:
        """Return what the detectors see in a frame.

        Raises:
            PerceptionError: the frame has nothing to look at, or no camera.
        """
        camera, size_px = camera_of(frame)
        clean = self._detector.detect(frame)
        scenes = {CLEAN: scene_of(clean.modality_detections, size_px, clean.dense, camera)}
        for number, one in enumerate(self._corruptions):
            for level in one.levels:
                rng = np.random.default_rng((self._seed, frame.index, number))
                corrupted = one.corrupt(frame, level, rng)
                output = self._affected[one.name].detect(corrupted)
                dense = clean.dense if output.dense is None else output.dense
                modality_detections = {**clean.modality_detections, **output.modality_detections}
                scenes[one.name, level] = scene_of(modality_detections, size_px, dense, camera)
        return scenes


def robustness_rows(
    detected: DetectedDrive[CorruptedScenes], key: tuple[str, float], fusion: Fusion
) -> Iterator[tuple[str, Sequence[Detections]]]:
    """Yield each modality, all of them merged, and our fusion, at one level of a disturbance."""
    scenes = [scenes[key] for scenes in detected.outputs]
    for modality in MODALITIES:
        if all(modality in scene.modality_detections for scene in scenes):
            yield (
                MODALITY_NAMES[modality],
                [scene.modality_detections[modality] for scene in scenes],
            )
    yield UNION_NAME, [merge(scene) for scene in scenes]
    yield VARIANT_NAMES["default"], [fusion.fuse_scene(scene).detections for scene in scenes]
