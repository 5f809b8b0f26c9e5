"""Metrics of the bird's-eye view: average precision by the distance of centres, over the scans of all processes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torchmetrics import Metric

from perception.detection.bev.boxes import BevDetections
from perception.evaluation.grouping import pairs_in_groups
from perception.evaluation.nuscenes.precision import (
    FREE,
    ClassCurves,
    match_centers,
    precision_over_recall,
)
from perception.evaluation.nuscenes.protocol import DISTANCES_M, ERRORS
from perception.types import Bool, Float64, Int

DISTANCE_M = 2.0
_COLUMNS = 6  # number of the scan, process, class, score, x, y


@dataclass(frozen=True)
class CenterPrecision:
    """Precision of one class.

    Attributes:
        ap: Average precision of centres within 2 m, 0..1.
        mean_ap: Mean of those within 0.5, 1, 2 and 4 m.
        labels: Number of labels that count.
        recall: Share of them that is found within 2 m at any score.
    """

    ap: float
    mean_ap: float
    labels: int
    recall: float


@dataclass(frozen=True)
class _Places:
    """Objects of one class in all scans, labelled or detected: (M, 2) centres and the (M,) scan of each."""

    centers_m: Float64
    scans: Int


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
    rows = rows[np.lexsort((-rows[:, 3], rows[:, 0]))]  # by scan, best first
    scans = rows[:, 0].astype(np.int64)
    views = np.array([one["view_rad"].numpy() for one in targets]).reshape(-1, 2)
    processes = np.full(len(targets), np.inf)
    np.minimum.at(processes, scans, rows[:, 1])
    counts = in_view(rows[:, 4:], views[scans]) & (rows[:, 1] == processes[scans])
    rows, scans = rows[counts], scans[counts]
    scans_of_labels = np.repeat(np.arange(len(targets)), [len(one["classes"]) for one in targets])
    boxes, classes, is_ignored = (
        _joined(targets, name) for name in ("boxes", "classes", "is_ignored")
    )
    labels = _Places(boxes[:, :2].astype(np.float64), scans_of_labels)
    ignored = _Places(labels.centers_m[is_ignored], labels.scans[is_ignored])
    precisions = {}
    for number, name in enumerate(class_names):
        is_label, is_found = (classes == number) & ~is_ignored, rows[:, 2] == number
        precisions[name] = _precision(
            _Places(labels.centers_m[is_label], labels.scans[is_label]),
            ignored,
            _Places(rows[is_found, 4:], scans[is_found]),
            rows[is_found, 3],
        )
    return precisions


def in_view(places_m: Float64, views_rad: Float64) -> Bool:
    """Return which (M, 2) places lie in the directions in which all is labelled, by their (M, 2) middles and half widths."""
    turns = np.arctan2(places_m[:, 1], places_m[:, 0]) - views_rad[:, 0]
    off = np.abs(np.arctan2(np.sin(turns), np.cos(turns)))
    return np.asarray(off <= views_rad[:, 1] + 1e-3)


def _precision(
    labels: _Places, ignored: _Places, found: _Places, scores: Float64
) -> CenterPrecision:
    """Return the precision of one class, as nuScenes' task measures it, but for ignored objects.

    A detection of these, which are of any class or have few returns, is neither right nor wrong.

    Args:
        labels: Labelled objects that count.
        ignored: Labelled objects that do not.
        found: Detected objects, by scan.
        scores: (D,) their scores.
    """
    ignored_m = np.full(len(scores), np.inf)
    first, second = pairs_in_groups(ignored.scans, found.scans)
    gaps_m = np.linalg.norm(ignored.centers_m[first] - found.centers_m[second], axis=1)
    np.minimum.at(ignored_m, second, gaps_m)
    order = np.argsort(-scores, kind="stable")
    matches = match_centers(
        labels.centers_m, labels.scans, found.centers_m[order], found.scans[order]
    )
    curves = []
    for distance_m, match in zip(DISTANCES_M, matches, strict=True):
        is_hit = match != FREE
        counts = is_hit | (ignored_m[order] >= distance_m)
        curves.append(precision_over_recall(is_hit[counts], len(labels.scans)))
    ap = ClassCurves(np.array(curves), np.full(len(ERRORS), np.nan)).ap
    at = DISTANCES_M.index(DISTANCE_M)
    hits, total = int((matches[at] != FREE).sum()), len(labels.scans)
    return CenterPrecision(float(ap[at]), float(ap.mean()), total, hits / max(total, 1))


def _joined(targets: Sequence[Mapping[str, Tensor]], name: str) -> np.ndarray:
    return np.concatenate([one[name].numpy() for one in targets])
