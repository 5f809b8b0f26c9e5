"""How many objects the proposals of a detector reach, by how many of them a frame are looked at.

A proposal claims no class. It reaches an object where both boxes overlap by an IoU or more; nothing is
matched one to one, as it does not matter whether another proposal reaches the same object.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perception.errors import PerceptionError
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.evaluation_boxes import (
    EvaluationBoxes,
    evaluation_mask,
    pair_boxes,
)
from perception.evaluation.detection.grouping import ranks_in_groups
from perception.evaluation.detection.protocol import DIFFICULTIES, DetectionClass, Difficulty
from perception.geometry.box_overlap_px import iou_px
from perception.types import Float64, Int

# Whatever is labelled, as the thesis counts (6.1.4); 2 is the highest level of KITTI's tracking labels.
EVERY_LABEL = Difficulty("all", min_height_px=0, max_occlusion=3, max_truncation=2)
IOU_THRESHOLDS = (0.7, 0.5)
IOU_STEPS = np.linspace(0, 1, 101)


@dataclass(frozen=True)
class RecallMetrics:
    """Objects of one difficulty.

    Attributes:
        objects: how many there are.
        ranks: for each IoU asked for, (objects,) how many proposals of its frame come before the first
            that reaches the object; -1 where none does.
        best_iou: (objects,) with the proposal that fits best; 0 without one.
    """

    objects: int
    ranks: dict[float, Int]
    best_iou: Float64

    def found(self, iou: float) -> int:
        """Return how many objects some proposal reaches."""
        return int((self.ranks[iou] >= 0).sum())

    def recall(self, iou: float) -> float:
        """Return the share of objects that some proposal reaches; NaN of none."""
        return self.found(iou) / self.objects if self.objects else float("nan")

    def recall_by_count(self, iou: float, most: int) -> Float64:
        """Return (most + 1,) the recall of the first 0, 1 .. proposals of each frame; NaN of no objects."""
        ranks = self.ranks[iou]
        reached = np.bincount(ranks[(ranks >= 0) & (ranks < most)], minlength=most)
        return _shares(np.append(0, np.cumsum(reached)), self.objects)

    def recall_by_iou(self) -> Float64:
        """Return (101,) the recall of all proposals at the IoUs of `IOU_STEPS`; NaN of no objects."""
        is_reached = (self.best_iou > 0) & (self.best_iou >= IOU_STEPS[:, None])
        return _shares(is_reached.sum(axis=1), self.objects)


@dataclass(frozen=True)
class ProposalRecall:
    """What the proposals of all frames reach.

    Attributes:
        frames: how many there are.
        proposals: in all frames together.
        max_per_frame: proposals of the frame that has most.
        difficulties: by name.
    """

    frames: int
    proposals: int
    max_per_frame: int
    difficulties: dict[str, RecallMetrics]

    @property
    def proposals_per_frame(self) -> float:
        """How many there are on average; NaN of no frames."""
        return self.proposals / self.frames if self.frames else float("nan")


def proposal_recall(
    truths: TrueBoxes,
    proposals: DetectedBoxes,
    frames: int,
    of_class: str,
    overlaps: Sequence[float] = IOU_THRESHOLDS,
    difficulties: Sequence[Difficulty] = (*DIFFICULTIES, EVERY_LABEL),
) -> ProposalRecall:
    """Measure which objects of a class have a proposal, and how soon it comes.

    Args:
        truths: labelled boxes of all frames.
        proposals: of all frames, the highest score looked at first; their types say nothing.
        frames: how many there are, with boxes or without.
        of_class: type of the objects that have to be found, in any case.
        overlaps: from which IoU on a proposal reaches an object.
        difficulties: which objects count.

    Raises:
        PerceptionError: an overlap cannot be reached or is no demand, or a box is of a frame beyond the last.
    """
    for iou in overlaps:
        require_iou(iou)
    evaluation_boxes = pair_boxes(truths, proposals, frames)
    ranks = {iou: _first_ranks(evaluation_boxes, iou) for iou in overlaps}
    best_iou = np.zeros(len(truths))
    np.maximum.at(best_iou, evaluation_boxes.overlaps.truths, evaluation_boxes.overlaps.iou)
    target_class = DetectionClass(of_class, iou=0)
    is_valid_truth = {
        one.name: evaluation_mask(evaluation_boxes, target_class, one).is_valid_truth
        for one in difficulties
    }
    return ProposalRecall(
        frames=frames,
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
    """Return (T,) how many of (G, 4) objects of one frame some of (M, 4) proposals reaches at each IoU."""
    best = iou_px(truths_px, proposals_px).max(axis=1, initial=0)
    return np.asarray((best >= np.asarray(overlaps)[:, None]).sum(axis=1), np.int64)


def require_iou(iou: float) -> None:
    """Refuse an overlap that is no demand, or that nothing reaches."""
    if not 0 < iou <= 1:
        raise PerceptionError("IoU of a proposal", expected="above 0, at most 1", found=f"{iou:g}")


def _first_ranks(evaluation_boxes: EvaluationBoxes, iou: float) -> Int:
    """Return (G,) the place of the first proposal that reaches each object among those of its frame."""
    proposals = evaluation_boxes.detections
    order = np.lexsort((-proposals.scores, proposals.frames))
    places = np.empty(len(proposals), np.int64)
    places[order] = ranks_in_groups(proposals.frames[order])
    reaching = evaluation_boxes.overlaps[evaluation_boxes.overlaps.iou >= iou]
    first = np.full(len(evaluation_boxes.truths), len(proposals))
    np.minimum.at(first, reaching.truths, places[reaching.detections])
    return np.where(first < len(proposals), first, -1)


def _shares(counts: Int, whole: int) -> Float64:
    return counts / whole if whole else np.full(len(counts), np.nan)
