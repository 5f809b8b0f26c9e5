"""Labelled and detected boxes of many frames, one row a box."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Annotated, Self

import numpy as np

from perception.errors import PerceptionError
from perception.evaluation.detection.protocol import NO_ALPHA_RAD
from perception.types import ArrayTable, Detections, Float64, Int, Labels


@dataclass(frozen=True)
class _BoxRows(ArrayTable):
    """M boxes in the order of their frames; within a frame, the order decides between equal scores.

    Attributes:
        frames: (M,) frame numbers from 0, in ascending order.
        types: (M,) class names, in any case.
        alphas_rad: (M,) observation angles of the headings; -10 where unknown.
        boxes_px: (M, 4) x1 y1 x2 y2.
    """

    frames: Int
    types: np.ndarray
    alphas_rad: Float64
    boxes_px: Annotated[Float64, 4]

    def __post_init__(self) -> None:
        """Validate lengths and shapes, finite numbers, and the order of the frames."""
        super().__post_init__()
        what = type(self).__name__
        for name in (field.name for field in fields(self)):
            column = getattr(self, name)
            if column.dtype.kind == "f" and not np.isfinite(column).all():
                raise PerceptionError(
                    f"{what}.{name}", expected="finite numbers", found="NaN or infinity"
                )
        if (np.diff(self.frames, prepend=0) < 0).any():
            raise PerceptionError(
                f"{what}.frames", expected="frames from 0 in ascending order", found="another order"
            )


@dataclass(frozen=True)
class TrueBoxes(_BoxRows):
    """G labelled boxes; regions without labels have the type DontCare.

    Attributes:
        truncation: (G,) share outside the image, 0 to 1; -1 of regions.
        occlusion: (G,) levels 0 to 3; -1 of regions.
    """

    truncation: Float64
    occlusion: Float64

    @classmethod
    def of_frames(cls, labels: Sequence[Labels]) -> Self:
        """Return the labels of one frame after the other, each frame's DontCare regions after its objects.

        Truncation stays as labelled, also where it is a level of tracking labels: 0 is within every limit on the
        share, 1 and 2 are beyond. Of the 18,472 objects in the labels of both of KITTI's benchmarks, 97 % of
        level 0 are truncated by no more than 0.15 and all by no more than 0.5, all but four of 1,050 of level 1
        by more than 0.5; of level 2, half of 633 are whole.
        """
        return cls.concatenate(cls._of_frame(number, one) for number, one in enumerate(labels))

    @classmethod
    def _of_frame(cls, number: int, labels: Labels) -> Self:
        regions = np.full(len(labels.dont_care_px), -1.0)
        types = [*labels.types.tolist(), *["DontCare"] * len(regions)]
        return cls(
            frames=np.full(len(types), number),
            types=np.array(types, np.str_),
            alphas_rad=np.full(len(types), NO_ALPHA_RAD),
            boxes_px=np.concatenate([labels.boxes_px, labels.dont_care_px], dtype=np.float64),
            truncation=np.append(labels.truncation, regions),
            occlusion=np.append(labels.occlusion, regions),
        )


@dataclass(frozen=True)
class DetectedBoxes(_BoxRows):
    """D detected boxes.

    Attributes:
        scores: (D,) scores of any scale, the higher the more confident.
    """

    scores: Float64

    @classmethod
    def of_frames(cls, detections: Sequence[Detections]) -> Self:
        """Return the detections of one frame after the other, without headings."""
        whole = Detections.concatenate(detections)
        counts = [len(found) for found in detections]
        return cls(
            frames=np.repeat(np.arange(len(counts)), counts),
            types=whole.types,
            alphas_rad=np.full(len(whole), NO_ALPHA_RAD),
            boxes_px=whole.boxes_px.astype(np.float64),
            scores=whole.scores.astype(np.float64),
        )
