"""Frames as the fusion of the detectors sees them: what each detector saw, and what is true."""

from dataclasses import dataclass, replace

import numpy as np

from perception.detection.fusion.detected_scene import DetectedScene
from perception.errors import PerceptionError
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.types import Detections, Int, Modality


@dataclass(frozen=True)
class DetectedFrames:
    """F frames.

    Attributes:
        scenes: (F) what the detectors saw.
        truth: labelled boxes of frames 0 .. F - 1.
        drive_numbers: (F,) which drive each frame is of.
    """

    scenes: tuple[DetectedScene, ...]
    truth: TrueBoxes
    drive_numbers: Int

    def __post_init__(self) -> None:
        """Refuse labels of other frames."""
        last = int(self.truth.frames.max(initial=-1))
        if last >= len(self.scenes) or len(self.drive_numbers) != len(self.scenes):
            raise PerceptionError(
                "detected frames",
                expected=f"labels and drives of {len(self.scenes)} frames",
                found=f"labels up to frame {last}, {len(self.drive_numbers)} drives",
            )

    def __len__(self) -> int:
        """Return F."""
        return len(self.scenes)

    def __getitem__(self, numbers: Int) -> "DetectedFrames":
        """Return the frames of numbers, in their order, numbered anew."""
        parts = [self.truth_of(number) for number in numbers.tolist()]
        renumbered = [replace(part, frames=np.full(len(part), k)) for k, part in enumerate(parts)]
        return DetectedFrames(
            tuple(self.scenes[number] for number in numbers.tolist()),
            TrueBoxes.concatenate([*renumbered, self.truth[np.zeros(0, np.int64)]]),
            self.drive_numbers[numbers],
        )

    def truth_of(self, number: int) -> TrueBoxes:
        """Return the labelled boxes of one frame."""
        first, end = np.searchsorted(self.truth.frames, [number, number + 1])
        return self.truth[np.arange(first, end)]

    def without(self, *lost: Modality) -> "DetectedFrames":
        """Return what is left where modalities are lost."""
        return replace(self, scenes=tuple(scene.without(*lost) for scene in self.scenes))

    def of_modality(self, modality: Modality) -> DetectedBoxes:
        """Return what one detector saw by itself."""
        empty = Detections.empty()
        return DetectedBoxes.of_frames(
            [scene.modality_detections.get(modality, empty) for scene in self.scenes]
        )
