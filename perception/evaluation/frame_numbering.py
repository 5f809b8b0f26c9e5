"""Whether the boxes of results fit the labels of the frame before or after theirs far better than those of their own."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from perception.evaluation.grouping import pairs_in_groups
from perception.evaluation.report import SummedMetrics
from perception.geometry.box_overlap_px import paired_iou_px
from perception.types import Float64, Int

OFFSETS = (0, -1, 1)  # of the frame whose labels are compared
_MIN_IOU = 0.5  # at one of the offsets, of a row that is compared
_MIN_ROWS = 10  # with fewer it may be chance
_MAX_ROWS = 2000  # drawn of each sequence: the time and memory of crowds stay small, shares are right to a percent
# On KITTI's tracking sequences, detectors and trackers with right numbers reach 0.40 and 0.86, those one frame late or
# early 0.60 to 1.00 and 1.2 to beyond 1000: a share of IoU 0.5 alone does not tell them apart at ten frames a second.
_MIN_BETTER, _MIN_ERROR_RATIO = 0.55, 1.15
_REASONS = {-1: "are frames counted from 1?", 1: "is the first frame left out of the count?"}


def _zeros() -> Float64:
    return np.zeros(len(OFFSETS))


@dataclass(frozen=True)
class NumberingFit(SummedMetrics):
    """Fit of rows with labels at each of `OFFSETS`; those of several sequences are added.

    Attributes:
        rows: Number of compared rows that have an IoU of at least 0.5 with a label at one of the offsets.
        better: (3,) numbers of these with a greater IoU than at their own frame.
        iou_sum: (3,) sums of the greatest IoU of each with a label.
    """

    rows: int = 0
    better: Float64 = field(default_factory=_zeros)
    iou_sum: Float64 = field(default_factory=_zeros)

    @property
    def offset(self) -> int:
        """Offset at which the rows fit far better than at their own frame, else 0."""
        best = int(self.better.argmax())
        own, other = self.rows - self.iou_sum[[0, best]]
        is_far = self.better[best] >= _MIN_BETTER * self.rows and own >= _MIN_ERROR_RATIO * other
        return OFFSETS[best] if is_far and self.rows >= _MIN_ROWS else 0


def numbering_fit(
    true_frames: Int, true_px: Float64, frames: Int, boxes_px: Float64
) -> NumberingFit:
    """Compare the boxes of results with the labels of their own frame, and of those before and after it.

    Args:
        true_frames: (G,) numbers of the frames of labels, in any order.
        true_px: (G, 4) labelled boxes x1 y1 x2 y2 of any class.
        frames: (D,) numbers of the frames of results.
        boxes_px: (D, 4) boxes of results.
    """
    if len(frames) > _MAX_ROWS:
        drawn = np.random.default_rng(0).choice(len(frames), _MAX_ROWS, replace=False)
        frames, boxes_px = frames[drawn], boxes_px[drawn]
    order = np.argsort(true_frames, kind="stable")
    iou = np.zeros((len(OFFSETS), len(frames)))
    for greatest, offset in zip(iou, OFFSETS, strict=True):
        rows, labels = pairs_in_groups(frames + offset, true_frames[order])
        np.maximum.at(greatest, rows, paired_iou_px(boxes_px[rows], true_px[order][labels]))
    iou = iou[:, iou.max(axis=0) >= _MIN_IOU]
    better = (iou > iou[0]).sum(axis=1, dtype=np.float64)
    return NumberingFit(iou.shape[1], better, iou.sum(axis=1))


def numbering_notes(fits: Mapping[str, NumberingFit]) -> list[str]:
    """Return a sentence for each offset at which results fit far better than at their own frames.

    Args:
        fits: Fit of the results of each sequence by its name.
    """
    notes = []
    for place, offset in enumerate(OFFSETS):
        found = {name: fit for name, fit in fits.items() if offset and fit.offset == offset}
        if found:
            total = sum(found.values(), NumberingFit())
            own, other = total.iou_sum[[0, place]] / total.rows
            notes.append(
                f"{', '.join(found)}: {100 * total.better[place] / total.rows:.0f} % of {total.rows} rows fit the labels of "
                f"frame k{offset:+d} better than those of their own frame k, IoU {other:.2f} instead of {own:.2f}: "
                f"{_REASONS[offset]} They are scored as they stand."
            )
    return notes
