"""Metrics of a detector: KITTI's average precision over the validation images of all processes."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor
from torchmetrics import Metric

from perception.detection.detectors.network_input import ImagePlacement
from perception.evaluation.detection.average_precision import (
    ClassCurves,
    DetectionMetrics,
    kitti_average_precision,
)
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from perception.evaluation.detection.protocol import (
    LEVELS,
    NO_ALPHA_RAD,
    kitti_class,
)
from perception.types import Detections

LOOSE_IOU = 0.5
_COLUMNS = 8  # number of the image, process, class, score, x1 y1 x2 y2


class ValidationBoxes(Metric):
    """All detections of an epoch, in all processes."""

    full_state_update = False
    rows: list[Tensor]

    def __init__(self, class_names: Sequence[str] = ()) -> None:
        super().__init__()
        self.add_state("rows", [], dist_reduce_fx="cat")
        self._class_names = list(class_names)

    def update(self, found: Sequence[Detections], numbers: Tensor, process: int) -> None:
        """Take a batch.

        Args:
            found: Detections in each image, in pixels of the input.
            numbers: (B,) numbers of the images in the validation set.
            process: Rank of the process.
        """
        for number, one in zip(numbers.tolist(), found, strict=True):
            rows = np.empty((len(one), _COLUMNS))
            rows[:, 0], rows[:, 1] = number, process
            rows[:, 2] = [self._class_names.index(name) for name in one.types.tolist()]
            rows[:, 3], rows[:, 4:] = one.scores, one.boxes_px
            self.rows.append(torch.from_numpy(rows).float().to(self.device))

    def compute(self) -> Tensor:
        """Return the rows of all processes."""
        rows = self.rows
        return torch.cat(rows) if isinstance(rows, list) else rows

    def gathered(self, placements: Sequence[ImagePlacement]) -> DetectedBoxes:
        """Return them in pixels of the original images, each image's from one process.

        Args:
            placements: (F) places in the input of the F images of the validation set.
        """
        rows = np.asarray(self.compute().cpu().numpy(), np.float64)
        numbers, processes = rows[:, :2].T.astype(np.int64)
        first = np.full(len(placements), np.iinfo(np.int64).max)
        np.minimum.at(first, numbers, processes)
        rows = rows[processes == first[numbers]]
        rows = rows[np.lexsort((-rows[:, 3], rows[:, 0]))]
        numbers, classes = rows[:, 0].astype(np.int64), rows[:, 2].astype(np.int64)
        boxes_px = rows[:, 4:]
        for number in np.unique(numbers).tolist():
            of_image = numbers == number
            boxes_px[of_image] = placements[number].to_image(boxes_px[of_image])
        return DetectedBoxes(
            frames=numbers,
            types=np.array(self._class_names, np.str_)[classes],
            alphas_rad=np.full(len(rows), NO_ALPHA_RAD),
            boxes_px=boxes_px,
            scores=rows[:, 3],
        )


def measure(
    truths: TrueBoxes, found: DetectedBoxes, frames: int, class_names: Sequence[str]
) -> DetectionMetrics:
    """Measure every class at the overlap that KITTI asks for, then every class at a half."""
    classes = [kitti_class(name) for name in class_names]
    both = [*classes, *(one.at_iou(LOOSE_IOU) for one in classes)]
    return kitti_average_precision(pair_boxes(truths, found, frames), both)


def mean_precision(metrics: DetectionMetrics) -> dict[str, float]:
    """Return average precision in percent over the classes: `easy` .. and `easy_50` .. at an IoU of a half."""
    parts = {
        "": [curves for one, curves in metrics.items() if one == kitti_class(one.name)],
        "_50": [curves for one, curves in metrics.items() if one.iou == LOOSE_IOU],
    }
    return {
        f"{level}{mark}": float(np.mean([precision(of, level) for of in classes]))
        for mark, classes in parts.items()
        for level in LEVELS
    }


def precision_table(metrics: DetectionMetrics) -> dict[str, dict[str, float]]:
    """Return average precision in percent by class and overlap, such as `Car 0.7`, and by difficulty."""
    return {
        f"{of_class.name} {of_class.iou:g}": {level: precision(curves, level) for level in LEVELS}
        for of_class, curves in metrics.items()
    }


def precision(curves: ClassCurves, difficulty: str) -> float:
    """Return the average precision in percent, 0 where nothing was detected."""
    curve = curves.get(difficulty)
    return curve.ap() if curve else 0.0
