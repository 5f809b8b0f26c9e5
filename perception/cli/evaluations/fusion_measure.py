"""What detectors and fusions come to on one drive, all on the same detections."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from perception.cli.evaluations.class_precision import ClassPrecision, MetricConfig
from perception.cli.evaluations.detection import BootstrapConfig
from perception.cli.evaluations.detection_figures import CONFIDENCE
from perception.cli.evaluations.fusion_steps import (
    MODALITY_NAMES,
    UNION_NAME,
    missing_modality_rows,
    modalities_of,
    step_rows,
    table_rows,
)
from perception.cli.evaluations.labelled_drives import DetectedDrive, LabelledDrive
from perception.detection.config import FusionVariant
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.rescoring import Fusion
from perception.evaluation.detection.bootstrap import Interval, percentile_interval
from perception.evaluation.detection.protocol import DetectionClass
from perception.evaluation.detection.reliability import (
    Reliability,
    match_correctness,
    measure_reliability,
)
from perception.types import Modality

Modalities = tuple[Modality, ...]
_BINS = 10  # of scores


@dataclass(frozen=True)
class Gain:
    """By how many points of average precision a row is ahead of others; the interval is NaN if not asked for."""

    points: float
    interval: Interval


@dataclass(frozen=True)
class MeasuredFusion:
    """What detectors and fusions are worth on one drive.

    Attributes:
        data: which frames.
        modalities: that they have.
        rows: of Table 7.10, by name; the single modalities first.
        missing_modalities: our fusion of what is left where modalities are lost, by what is left.
        steps: of our fusion, by name (Fig. 7.14).
        reliability: at the first IoU, of every row but the merged one, whose scores no network gave.
    """

    data: LabelledDrive
    modalities: Modalities
    rows: Mapping[str, ClassPrecision]
    missing_modalities: Mapping[Modalities, ClassPrecision]
    steps: Mapping[str, ClassPrecision]
    reliability: Mapping[str, Reliability]

    def singles(self, modalities: Modalities) -> list[ClassPrecision]:
        """Return what modalities are worth each by itself."""
        return [self.rows[MODALITY_NAMES[name]] for name in modalities]

    def gain(self, row: str, iou: float, difficulty: str) -> Gain:
        """Return how far a row of the table is ahead of the best modality."""
        return gain_over_best(self.rows[row], self.singles(self.modalities), iou, difficulty)

    def remaining_gain(self, remaining: Modalities, iou: float, difficulty: str) -> Gain:
        """Return how far the fusion of what is left is ahead of the best of it."""
        return gain_over_best(
            self.missing_modalities[remaining], self.singles(remaining), iou, difficulty
        )


def measure_fusion(
    detected: DetectedDrive[DetectedScene],
    fusions: Mapping[FusionVariant, Fusion],
    of_class: DetectionClass,
    config: MetricConfig,
) -> MeasuredFusion:
    """Measure every row on the same detections."""
    default_fusion = fusions["default"]
    without_intervals = replace(config, resampling=BootstrapConfig())
    detections = dict(table_rows(detected, fusions))
    boxes = {name: detected.with_labels(of_row) for name, of_row in detections.items()}
    frames, target_class = len(detected.outputs), of_class.at_iou(config.iou_thresholds[0])
    return MeasuredFusion(
        data=detected.data,
        modalities=modalities_of(detected),
        rows={name: ClassPrecision.of(found, of_class, config) for name, found in boxes.items()},
        missing_modalities={
            remaining: ClassPrecision.of(detected.with_labels(of_row), of_class, config)
            for remaining, of_row in missing_modality_rows(detected, default_fusion)
        },
        steps={
            name: ClassPrecision.of(detected.with_labels(of_row), of_class, without_intervals)
            for name, of_row in step_rows(detected, default_fusion)
        },
        reliability={
            name: measure_reliability(
                match_correctness(found.truths, found.detections, frames, target_class), _BINS
            )
            for name, found in boxes.items()
            if name != UNION_NAME
        },
    )


def gain_over_best(
    row: ClassPrecision, others: Sequence[ClassPrecision], iou: float, difficulty: str
) -> Gain:
    """Return how far a row is ahead of the best of others; on every choice of frames, of the best there."""
    points = row.ap(iou, difficulty) - max(one.ap(iou, difficulty) for one in others)
    own = row.samples(iou, difficulty)
    of_others = [one.samples(iou, difficulty) for one in others]
    known = [samples for samples in of_others if len(samples) == len(own)]
    if not len(own) or not known:
        return Gain(points, Interval(np.nan, np.nan))
    return Gain(points, percentile_interval(own - np.max(known, axis=0), CONFIDENCE))
