"""Metrics of a verifier: classification of vehicles, and IoU of their boxes."""

import torch
from torch import Tensor
from torchmetrics import Metric

from train.box_overlap import paired_iou


class VerifierMetrics(Metric):
    """Counts over the batches of an epoch, summed over all processes.

    accuracy           fraction of the crops that are classified correctly
    balanced_accuracy  mean accuracy of both classes
    precision          fraction of the crops classified as vehicles that are vehicles
    recall             fraction of the vehicles that are classified as such
    box_iou            mean IoU of the vehicles' boxes with the labels'
    box_iou_over_0.7   fraction of the vehicles' boxes with an IoU above 0.7, KITTI's minimum
    """

    full_state_update = False
    is_right: Tensor
    is_wrong: Tensor
    iou_sum: Tensor
    good_boxes: Tensor
    boxes: Tensor

    def __init__(self, *, sync_on_compute: bool = True) -> None:
        """Start without a batch.

        Args:
            sync_on_compute: Whether all processes of a training sum their counts, and so all have to ask for them.
        """
        super().__init__(sync_on_compute=sync_on_compute)
        # By what they are: not vehicles, vehicles.
        for name in ("is_right", "is_wrong"):
            self.add_state(name, torch.zeros(2, dtype=torch.long), dist_reduce_fx="sum")
        self.add_state("iou_sum", torch.zeros(()), dist_reduce_fx="sum")
        for name in ("good_boxes", "boxes"):
            self.add_state(name, torch.zeros((), dtype=torch.long), dist_reduce_fx="sum")

    def update(
        self, logits: Tensor, shares: Tensor, is_vehicle: Tensor, normalized_box: Tensor
    ) -> None:
        """Count a batch of M crops.

        Args:
            logits: (M,) logits of a vehicle.
            shares: (M, 4) predicted boxes.
            is_vehicle: (M,) mask of the vehicles.
            normalized_box: (M, 4) boxes of the labels, NaN where there is none.
        """
        truth = is_vehicle.long()
        is_right = (logits > 0).long() == truth
        self.is_right += torch.bincount(truth[is_right], minlength=2)
        self.is_wrong += torch.bincount(truth[~is_right], minlength=2)
        has_box = is_vehicle.bool() & normalized_box.isfinite().all(1)
        overlaps = paired_iou(shares[has_box].float(), normalized_box[has_box].float())
        self.iou_sum += overlaps.sum()
        self.good_boxes += (overlaps > 0.7).sum()
        self.boxes += has_box.sum()

    def compute(self) -> dict[str, Tensor]:
        """Return the metrics, 0 where there is nothing to divide by."""
        total = self.is_right + self.is_wrong
        found = self.is_right[1]
        return {
            "accuracy": _share(self.is_right.sum(), total.sum()),
            "balanced_accuracy": _share(self.is_right, total).mean(),
            "precision": _share(found, found + self.is_wrong[0]),
            "recall": _share(found, total[1]),
            "box_iou": _share(self.iou_sum, self.boxes),
            "box_iou_over_0.7": _share(self.good_boxes, self.boxes),
        }


def _share(part: Tensor, whole: Tensor) -> Tensor:
    return part / whole.clamp(min=1)
