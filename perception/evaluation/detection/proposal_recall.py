"""Recall of the proposals of a detector, by IoU and by the number of proposals of a frame.

A proposal has no class. It recalls an object if their boxes overlap by the IoU threshold or more; there is no
one-to-one matching, since several proposals may recall the same object.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perception.errors import PerceptionError
from perception.evaluation.detection.evaluation_boxes import (
    EvaluationBoxes,
    evaluation_mask,
)
from perception.evaluation.detection.protocol import DIFFICULTIES, DetectionClass, Difficulty
from perception.evaluation.grouping import ranks_in_groups
from perception.geometry.box_overlap_px import iou_px
from perception.types import Float64, Int

# All labels, as in the thesis (6.1.4); 2 is the highest truncation level of KITTI's tracking labels.
EVERY_LABEL = Difficulty("all", min_height_px=0, max_occlusion=3, max_truncation=2)
IOU_THRESHOLDS = (0.7, 0.5)
IOU_STEPS = np.linspace(0, 1, 101)


@dataclass(frozen=True)
class RecallMetrics:
    """Recall of the O objects of one difficulty.

    Attributes:
        objects: Number of objects, O.
        ranks: (O,) for each IoU threshold the rank, from 0, of the first proposal of the frame that recalls the
            object; -1 where none does.
        best_iou: (O,) maximum IoU with a proposal; 0 without one.
    """

    objects: int
    ranks: dict[float, Int]
    best_iou: Float64

    def found(self, iou: float) -> int:
        """Return the number of objects that a proposal recalls."""
        return int((self.ranks[iou] >= 0).sum())

    def recall(self, iou: float) -> float:
        """Return the share of objects that a proposal recalls; NaN without objects."""
        return self.found(iou) / self.objects if self.objects else float("nan")

    def recall_by_count(self, iou: float, most: int) -> Float64:
        """Return (most + 1,) the recall of the first 0, 1 .. proposals of each frame; NaN without objects."""
        ranks = self.ranks[iou]
        reached = np.bincount(ranks[(ranks >= 0) & (ranks < most)], minlength=most)
        return _shares(np.append(0, np.cumsum(reached)), self.objects)

    def recall_by_iou(self) -> Float64:
        """Return (101,) the recall of all proposals at the IoUs of `IOU_STEPS`; NaN without objects."""
        is_reached = (self.best_iou > 0) & (self.best_iou >= IOU_STEPS[:, None])
        return _shares(is_reached.sum(axis=1), self.objects)


@dataclass(frozen=True)
class ProposalRecall:
    """Recall of the proposals of all frames.

    Attributes:
        frames: Number of frames.
        proposals: Number of proposals of all frames.
        max_per_frame: Maximum number of proposals of a frame.
        difficulties: Recall by difficulty.
    """

    frames: int
    proposals: int
    max_per_frame: int
    difficulties: dict[str, RecallMetrics]

    @property
    def proposals_per_frame(self) -> float:
        """Mean number of proposals of a frame; NaN without frames."""
        return self.proposals / self.frames if self.frames else float("nan")


def proposal_recall(
    boxes: EvaluationBoxes,
    class_name: str,
    overlaps: Sequence[float] = IOU_THRESHOLDS,
) -> ProposalRecall:
    """Return the recall of the proposals for the objects of a class.

    Args:
        boxes: Labelled boxes and proposals, ranked by their scores; their classes are not used.
        class_name: Class of the objects, in any case.
        overlaps: IoU thresholds from which on a proposal recalls an object.

    Raises:
        PerceptionError: an IoU is out of range.
    """
    for iou in overlaps:
        require_iou(iou)
    proposals = boxes.detections
    ranks = {iou: _first_ranks(boxes, iou) for iou in overlaps}
    best_iou = np.zeros(len(boxes.truths))
    np.maximum.at(best_iou, boxes.overlaps.truths, boxes.overlaps.iou)
    target_class = DetectionClass(class_name, iou=0)
    is_valid_truth = {
        one.name: evaluation_mask(boxes, target_class, one).is_valid_truth
        for one in (*DIFFICULTIES, EVERY_LABEL)
    }
    return ProposalRecall(
        frames=boxes.frames,
        proposals=len(proposals),
        max_per_frame=int(np.bincount(proposals.frames).max(initial=0)),
        difficulties={
            name: RecallMetrics(
                objects=int(valid.sum()),
                ranks={iou: of_iou[valid] for iou, of_iou in ranks.items()},
                best_iou=best_iou[valid],
            )
            for name, valid in is_valid_truth.items()
        },
    )


def count_recalled(truths_px: Float64, proposals_px: Float64, overlaps: Sequence[float]) -> Int:
    """Return (T,) the number of (G, 4) objects of one frame that (M, 4) proposals recall at each of T IoUs."""
    best = iou_px(truths_px, proposals_px).max(axis=1, initial=0)
    return np.asarray((best >= np.asarray(overlaps)[:, None]).sum(axis=1), np.int64)


def require_iou(iou: float) -> None:
    """Validate an IoU threshold: above 0, at most 1."""
    if not 0 < iou <= 1:
        raise PerceptionError("IoU of a proposal", expected="above 0, at most 1", found=f"{iou:g}")


def _first_ranks(boxes: EvaluationBoxes, iou: float) -> Int:
    """Return (G,) the rank of the first proposal of the frame that recalls each object, -1 without one."""
    proposals = boxes.detections
    order = np.lexsort((-proposals.scores, proposals.frames))
    places = np.empty(len(proposals), np.int64)
    places[order] = ranks_in_groups(proposals.frames[order])
    reaching = boxes.overlaps[boxes.overlaps.iou >= iou]
    first = np.full(len(boxes.truths), len(proposals))
    np.minimum.at(first, reaching.truths, places[reaching.detections])
    return np.where(first < len(proposals), first, -1)


def _shares(counts: Int, whole: int) -> Float64:
    return counts / whole if whole else np.full(len(counts), np.nan)
