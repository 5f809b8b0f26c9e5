"""Labelled frames with the detections of each modality."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from perception.detection.fusion.detected_scene import (
    MIN_FUSED,
    DetectedScene,
    remaining_sets,
)
from perception.errors import PerceptionError
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.types import MODALITIES, Detections, Int, Modality


@dataclass(frozen=True)
class DetectedFrames:
    """F frames.

    Attributes:
        scenes: (F) detections of each frame.
        truth: Labelled boxes of frames 0 .. F - 1.
    """

    scenes: tuple[DetectedScene, ...]
    truth: TrueBoxes

    def __post_init__(self) -> None:
        """Validate that labels are of these frames."""
        last = int(self.truth.frames.max(initial=-1))
        if last >= len(self.scenes):
            raise PerceptionError(
                "detected frames",
                expected=f"labels of {len(self.scenes)} frames",
                found=f"labels up to frame {last}",
            )

    def __len__(self) -> int:
        """Return F."""
        return len(self.scenes)

    def __getitem__(self, numbers: Int) -> "DetectedFrames":
        """Return the frames of numbers in their order, renumbered from 0."""
        parts = [self.truth_of(number) for number in numbers.tolist()]
        renumbered = [replace(part, frames=np.full(len(part), k)) for k, part in enumerate(parts)]
        return DetectedFrames(
            tuple(self.scenes[number] for number in numbers.tolist()),
            TrueBoxes.concatenate([*renumbered, self.truth[np.zeros(0, np.int64)]]),
        )

    @property
    def modalities(self) -> tuple[Modality, ...]:
        """Modalities that some frame was searched in."""
        return tuple(
            name
            for name in MODALITIES
            if any(name in scene.modality_detections for scene in self.scenes)
        )

    def remaining(self) -> Iterator["DetectedFrames"]:
        """Yield the frames with every set of their modalities that can be fused, all of them first."""
        for names in remaining_sets(self.modalities, MIN_FUSED):
            yield self.without(*(name for name in self.modalities if name not in names))

    def truth_of(self, number: int) -> TrueBoxes:
        """Return the labelled boxes of one frame."""
        first, end = np.searchsorted(self.truth.frames, [number, number + 1])
        return self.truth[np.arange(first, end)]

    def without(self, *missing: Modality) -> "DetectedFrames":
        """Return the frames without the detections of some modalities."""
        return replace(self, scenes=tuple(scene.without(*missing) for scene in self.scenes))

    def of_modality(self, modality: Modality) -> DetectedBoxes:
        """Return the boxes of one detector."""
        empty = Detections.empty()
        return DetectedBoxes.of_frames(
            [scene.modality_detections.get(modality, empty) for scene in self.scenes]
        )
