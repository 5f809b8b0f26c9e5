"""Errors of a run against the labels of its drive: the ground frame by frame, and the precision of the vehicles."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from perception.detection.vehicles.camera_views import views_of
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.class_precision import ClassPrecision, measure_precision
from perception.evaluation.detection.config import PrecisionConfig
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from perception.evaluation.detection.protocol import KITTI_CLASSES, DetectionClass
from perception.evaluation.ground import ground_errors
from perception.geometry.grids import LocalArea
from perception.types import Detections, Labels, Result

FUSED = "fused"


@dataclass(frozen=True)
class GroundError:
    """Error of the ground in one frame.

    Attributes:
        frame: Index of the frame.
        objects: Number of labelled objects in the local area.
        mean_m: Mean distance of their bottom centres from the ground; None without objects.
        max_m: Largest distance; None without objects.
    """

    frame: int
    objects: int
    mean_m: float | None
    max_m: float | None


@dataclass(frozen=True)
class PrecisionPanel:
    """Precision-recall curves of one panel.

    Attributes:
        title: Class and how detections are matched.
        curves: (41,) precision at evenly spaced recalls from 0 to 1, by `name: note`.
    """

    title: str
    curves: dict[str, list[float]]


class LabelErrors:
    """Accumulates the errors of a run against labels, frame by frame."""

    def __init__(self, area: LocalArea) -> None:
        """Start without a frame.

        Args:
            area: Area over which the ground counts.
        """
        self.ground: list[GroundError] = []
        self._area = area
        self._labels: list[Labels] = []
        self._detections: dict[str, list[Detections]] = {}

    def update(self, result: Result, labels: Labels) -> None:
        """Add one frame."""
        index = result.frame.index
        errors_m = np.abs(
            ground_errors(index, result.ground, labels.boxes_velo.bottom_m, self._area).errors_m
        )
        known = bool(len(errors_m))
        mean_m = round(float(errors_m.mean()), 5) if known else None
        max_m = round(float(errors_m.max()), 5) if known else None
        self.ground.append(GroundError(index, len(errors_m), mean_m, max_m))
        result = views_of(result)[0]  # labels are of the main camera
        if result.vehicles is None:
            return
        found: dict[str, Detections] = {FUSED: result.vehicles.fused.detections}
        found.update({str(n): one for n, one in result.modality_detections.items()})
        for name, detections in found.items():
            missed = [Detections.empty()] * (
                len(self._labels) - len(self._detections.get(name, ()))
            )
            self._detections.setdefault(name, []).extend([*missed, detections])
        self._labels.append(labels)

    def precision(self) -> list[PrecisionPanel]:
        """Return the curves of each class that is labelled, and of each detector of its most frequent class."""
        if not self._labels:
            return []
        truths = TrueBoxes.of_frames(self._labels)
        names = np.char.lower(truths.types.astype(np.str_))
        counts = {one: int(np.sum(names == one.name.lower())) for one in KITTI_CLASSES}
        classes = sorted((one for one in counts if counts[one]), key=lambda one: -counts[one])
        if not classes:
            return []
        first, *others = classes
        by_detector = {
            name: self._measured(truths, found, first) for name, found in self._detections.items()
        }
        fused = [by_detector[FUSED]]
        fused += [self._measured(truths, self._detections[FUSED], one) for one in others]
        return [*map(_by_difficulty, fused), _by_detector(by_detector)]

    def _measured(
        self, truths: TrueBoxes, found: Sequence[Detections], of_class: DetectionClass
    ) -> ClassPrecision:
        padded = [*found, *[Detections.empty()] * (len(self._labels) - len(found))]
        boxes = pair_boxes(truths, DetectedBoxes.of_frames(padded), len(self._labels))
        return measure_precision(boxes, of_class, PrecisionConfig(iou=(of_class.iou,)))


def _by_difficulty(precision: ClassPrecision) -> PrecisionPanel:
    (iou,) = precision.metrics
    curves = {
        f"{level}: {one.ap():.1f} % of {one.objects}": one.curve.precision.tolist()
        for level, one in precision.first.items()
        if one.curve is not None
    }
    return PrecisionPanel(f"{precision.name}, fused, IoU over {iou:g}", curves)


def _by_detector(precisions: Mapping[str, ClassPrecision]) -> PrecisionPanel:
    first = next(iter(precisions.values()))
    (iou,) = first.metrics
    at_level = {name: one.first["moderate"] for name, one in precisions.items()}
    curves = {
        f"{name}: {one.ap():.1f} %": one.curve.precision.tolist()
        for name, one in at_level.items()
        if one.curve is not None
    }
    return PrecisionPanel(f"{first.name} by detector, moderate, IoU over {iou:g}", curves)
