"""Metrics of the bird's-eye view: average precision by the distance of centres, over the scans of all processes."""

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import Tensor
from torchmetrics import Metric

from perception.detection.bev.boxes import BevDetections
from perception.evaluation.detection.center_precision import (
    CenterFrame,
    CenterPrecision,
    center_precision,
)
from perception.types import Bool, Float64

DISTANCE_M = 2.0
_COLUMNS = 6  # number of the scan, process, class, score, x, y


class FoundCenters(Metric):
    """All detections of an epoch, in all processes."""

    full_state_update = False
    rows: list[Tensor]

    def __init__(self) -> None:
        super().__init__()
        self.add_state("rows", [], dist_reduce_fx="cat")

    def update(self, found: Sequence[BevDetections], numbers: Tensor, process: int) -> None:
        """Take the detections of some scans, of some numbers, in a process."""
        for number, one in zip(numbers.tolist(), found, strict=True):
            rows = np.empty((len(one), _COLUMNS))
            rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3] = (
                number,
                process,
                one.classes,
                one.scores,
            )
            rows[:, 4:] = one.boxes.bottom_m[:, :2]
            self.rows.append(torch.from_numpy(rows).float().to(self.device))

    def compute(self) -> Tensor:
        """Return the rows of all processes."""
        rows = self.rows
        if isinstance(rows, list):
            return torch.cat(rows) if rows else torch.zeros(0, _COLUMNS)
        return rows


def measure(
    targets: Sequence[Mapping[str, Tensor]], found: Tensor, class_names: Sequence[str]
) -> dict[str, CenterPrecision]:
    """Return the precision of each class.

    Args:
        targets: Targets of each scan, as `BevDataset` makes them.
        found: Rows of `FoundCenters`.
        class_names: Classes in order.
    """
    rows: Float64 = found.cpu().numpy().astype(np.float64)
    precisions = {}
    for number, name in enumerate(class_names):
        of_class = rows[rows[:, 2] == number]
        frames = []
        for scan, target in enumerate(targets):
            here = of_class[of_class[:, 0] == scan]
            here = here[here[:, 1] == here[:, 1].min(initial=np.inf)]  # of one process
            is_ignored: Bool = target["is_ignored"].numpy()
            counts = (target["classes"].numpy() == number) | is_ignored
            boxes = target["boxes"].numpy()[counts]
            inside = in_view(here[:, 4:], target["view_rad"].numpy())
            frames.append(CenterFrame(boxes[:, :2].astype(np.float64), is_ignored[counts], here[inside, 4:], here[inside, 3]))  # fmt: skip
        precisions[name] = center_precision(frames, DISTANCE_M)
    return precisions


def in_view(places_m: Float64, view_rad: np.ndarray) -> Bool:
    """Return which (M, 2) places lie in the directions in which everything is labelled, by their middle and half width."""
    turns = np.arctan2(places_m[:, 1], places_m[:, 0]) - view_rad[0]
    off = np.abs(np.arctan2(np.sin(turns), np.cos(turns)))
    return np.asarray(off <= view_rad[1] + 1e-3)
