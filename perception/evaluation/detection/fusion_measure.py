"""Metrics of the fusion of three detectors beside each of them alone (Table 7.10, Fig. 7.14).

All rows rest on the same detections: each modality alone, all modalities merged by non-maximum suppression, and
each variant of the fusion; then the fusion where modalities are missing. Each class has its own rows. The scores of
KITTI's benchmark, with those of the 3D boxes, are of the fusion alone.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from perception.detection.config import FusionVariant
from perception.detection.fusion.detected_scene import DetectedScene, remaining_sets
from perception.detection.fusion.nms_fusion import NmsFusion
from perception.detection.fusion.rescoring import Fusion
from perception.evaluation.detection.average_precision import (
    NO_INTERVAL,
    percentile_interval,
)
from perception.evaluation.detection.benchmark_scores import BenchmarkScores, measure_benchmark
from perception.evaluation.detection.box_rows import DetectedBoxes, LocatedDetections, TrueBoxes
from perception.evaluation.detection.class_precision import (
    CONFIDENCE,
    ClassPrecision,
    PrecisionMeasure,
    few_objects_note,
    level_panel,
)
from perception.evaluation.detection.config import PUBLISHED_CLASS
from perception.evaluation.detection.estimates import (
    Estimate,
    EstimateRow,
    estimate_column,
    estimate_table,
)
from perception.evaluation.detection.evaluation_boxes import EvaluationBoxes
from perception.evaluation.detection.protocol import LEVELS
from perception.evaluation.detection.reliability import (
    Reliability,
    match_correctness,
    measure_reliability,
)
from perception.evaluation.report import Report, Table
from perception.render.curve_plots import CurvePanel
from perception.types import MODALITIES, Detections, Modality

Fuse = Callable[[DetectedScene], Detections]

# Rows as Table 7.10 names them.
MODALITY_NAMES: Mapping[Modality, str] = {"rgb": "color", "dm": "depth", "rm": "reflectance"}
VARIANT_NAMES: Mapping[FusionVariant, str] = {
    "scores": "fusion on scores",
    "features": "fusion on all features",
    "default": "Trifuse fusion",
}
MERGED = "merged by NMS"
WITH_BEV = "with bird's-eye view"
PERFECT = "perfect detector"
# Table 7.10: easy, moderate, hard. Fig. 7.14 has 53.60 for the last; the text's gain of 1.05 points fits 55.10.
THESIS_PERCENT: Mapping[str, Sequence[float]] = {
    MODALITY_NAMES["rgb"]: (73.93, 61.69, 54.00),
    MODALITY_NAMES["dm"]: (68.19, 54.59, 47.61),
    MODALITY_NAMES["rm"]: (68.36, 52.23, 45.22),
    VARIANT_NAMES["scores"]: (74.21, 62.18, 54.06),
    VARIANT_NAMES["features"]: (75.13, 62.74, 55.10),
}
_THESIS_IOU = 0.7
_THESIS_NOTE = (
    "Thesis: Table 7.10, on frames of KITTI's training set that are not named, over 11 recall points; "
    "not comparable."
)
_STEPS_LEVEL = "moderate"
_BINS = 10  # of scores


@dataclass(frozen=True)
class FusionRow:
    """Row of Table 7.10.

    Attributes:
        precision: Metrics of the row.
        singles: Metrics of each modality that the row joins; none of a single modality.
    """

    precision: ClassPrecision
    singles: tuple[ClassPrecision, ...] = ()

    def estimates(self, iou: float) -> EstimateRow:
        """Return the average precision by difficulty."""
        return {
            level: Estimate(one.ap(one.recall_points[0]), one.interval(one.recall_points[0]))
            for level, one in self.precision.metrics[iou].items()
        }

    def gains(self, iou: float) -> EstimateRow:
        """Return the gain over the best of the modalities; in each resample, over the best of that resample."""
        gains = {}
        for level, own in self.precision.metrics[iou].items():
            points = own.recall_points[0]
            singles = [one.metrics[iou][level] for one in self.singles]
            gain = own.ap(points) - max(one.ap(points) for one in singles)
            samples = own.resampled_ap(points)
            known = [one for s in singles if len(one := s.resampled_ap(points)) == len(samples)]
            interval = NO_INTERVAL
            if len(samples) and known:
                interval = percentile_interval(samples - np.max(known, axis=0), CONFIDENCE)
            gains[level] = Estimate(gain, interval)
        return gains


@dataclass(frozen=True)
class LocatedScene:
    """Detections of one frame.

    Attributes:
        scene: Detections of each modality in an image.
        fused: Detections of the fusion, located in the scan.
        has_bev: Whether objects of the bird's-eye view are joined with these.
    """

    scene: DetectedScene
    fused: LocatedDetections
    has_bev: bool = False


@dataclass(frozen=True)
class ClassFusionReport(Report):
    """Metrics of detectors and fusions on one drive for one class.

    Attributes:
        rows: Rows of Table 7.10 by name, the single modalities first.
        missing_modalities: Trifuse's fusion with modalities missing, by the remaining ones, such as rgb+dm.
        steps: Boxes before rescoring, after it, and after suppression (Fig. 7.14).
        reliability: Reliability of the scores at the first IoU, of each row with scores of a network.
    """

    rows: Mapping[str, FusionRow]
    missing_modalities: Mapping[str, FusionRow]
    steps: Mapping[str, ClassPrecision]
    reliability: Mapping[str, Reliability]

    def tables(self) -> Sequence[Table[Any]]:
        """Return four tables for each IoU: rows, gains, both with modalities missing; notes below the last."""
        tables = [table for iou in self._first.metrics for table in self._tables_at(iou)]
        return [*tables[:-1], replace(tables[-1], notes=list(self._notes()))]

    def to_json(self) -> dict[str, Any]:
        """Return all metrics, and those of the thesis."""
        return {
            **_rows_document(self.rows),
            "missing_modalities": _rows_document(self.missing_modalities),
            "steps": {name: one.to_json() for name, one in self.steps.items()},
            "calibration": {name: one.to_json() for name, one in self.reliability.items()},
            "thesis_table_7_10": THESIS_PERCENT,
        }

    def panels(self) -> list[CurvePanel]:
        """Return the curves at the first IoU: of the rows by difficulty, and of the steps."""
        iou = next(iter(self._first.metrics))
        rows = {name: row.precision for name, row in self.rows.items()}
        panels = [level_panel(f"{level}, IoU over {iou:g}", rows, level, iou) for level in LEVELS]
        title = f"steps of the fusion, {_STEPS_LEVEL}"
        steps = level_panel(title, self.steps, _STEPS_LEVEL, iou)
        return [*panels, steps]

    @property
    def _first(self) -> ClassPrecision:
        return next(iter(self.rows.values())).precision

    @property
    def _is_of_thesis(self) -> bool:
        return self._first.name == PUBLISHED_CLASS

    def _tables_at(self, iou: float) -> Iterator[Table[Any]]:
        first = self._first.metrics[iou]
        (points, *_) = first[LEVELS[0]].recall_points
        ap, at_iou = f"AP R{points} [%]", f"IoU over {iou:g}"
        rows = {name: row.estimates(iou) for name, row in self.rows.items()}
        if self._is_of_thesis and iou == _THESIS_IOU:
            rows = {name: {**row, **_thesis(name)} for name, row in rows.items()}
        perfect = {level: Estimate(one.max_ap(points)) for level, one in first.items()}
        yield _table(f"{ap}, {at_iou}", {**rows, PERFECT: perfect}, ".2f")
        gains = {name: row.gains(iou) for name, row in self.rows.items() if row.singles}
        yield _table(f"Gain over the best modality [points], {at_iou}", gains, "+.2f")
        missing = {_words(name): row for name, row in self.missing_modalities.items()}
        title = f"Missing modalities: {ap} of Trifuse's fusion of the remaining, {at_iou}"
        yield _table(title, {name: row.estimates(iou) for name, row in missing.items()}, ".2f")
        title = f"Missing modalities: gain over the best remaining modality [points], {at_iou}"
        yield _table(title, {name: row.gains(iou) for name, row in missing.items()}, "+.2f")

    def _notes(self) -> Iterator[str]:
        objects = {level: one.objects for level, one in self._first.first.items()}
        yield "Objects: " + ", ".join(f"{count} {level}" for level, count in objects.items())
        yield "Expected calibration error [points]: " + ", ".join(
            f"{name} {100 * one.expected_calibration_error:.1f}"
            for name, one in self.reliability.items()
        )
        yield from few_objects_note(objects.values())
        if self._is_of_thesis and _THESIS_IOU in self._first.metrics:
            yield _THESIS_NOTE


@dataclass(frozen=True)
class FusionReport(Report):
    """Metrics of detectors and fusions on one drive.

    Attributes:
        benchmark: Scores of the fusion in KITTI's benchmark, with those of the 3D boxes.
        classes: Metrics of each class by its name.
    """

    benchmark: BenchmarkScores
    classes: Mapping[str, ClassFusionReport]
    median_frame_ms: None = field(default=None, init=False)  # detections are cached

    @property
    def by_class(self) -> Mapping[str, ClassPrecision]:
        """Metrics of Trifuse's fusion for each class by its name."""
        row = VARIANT_NAMES["default"]
        return {name: one.rows[row].precision for name, one in self.classes.items()}

    def tables(self) -> Sequence[Table[Any]]:
        """Return the benchmark's table, and those of each class."""
        tables = [
            replace(table, title=f"{name}: {table.title}")
            for name, report in self.classes.items()
            for table in report.tables()
        ]
        return [*self.benchmark.tables(), *tables]

    def panels(self) -> list[CurvePanel]:
        """Return the curves of each class."""
        return [
            replace(panel, title=f"{name}, {panel.title}")
            for name, report in self.classes.items()
            for panel in report.panels()
        ]


def _rows_document(rows: Mapping[str, FusionRow]) -> dict[str, Any]:
    return {
        "rows": {name: row.precision.to_json() for name, row in rows.items()},
        "gain_points": {
            name: {f"{iou:g}": row.gains(iou) for iou in row.precision.metrics}
            for name, row in rows.items()
            if row.singles
        },
    }


def _table(title: str, rows: Mapping[str, EstimateRow], spec: str) -> Table[EstimateRow]:
    """Return the table of the rows, with the values of the thesis where they are known."""
    thesis = [f"thesis {level}" for level in LEVELS]
    has_thesis = any(thesis[0] in row for row in rows.values())
    further = [estimate_column(name, spec) for name in thesis] if has_thesis else []
    return estimate_table(title, rows, spec, further)


def _thesis(name: str) -> EstimateRow:
    percent = THESIS_PERCENT.get(name, (None, None, None))
    return {f"thesis {level}": Estimate(x) for level, x in zip(LEVELS, percent, strict=True)}


def _words(modalities: str) -> str:
    """Return rgb+dm as color + depth."""
    names = {str(modality): name for modality, name in MODALITY_NAMES.items()}
    return " + ".join(names[modality] for modality in modalities.split("+"))


@dataclass(frozen=True)
class _Precision:
    """Metrics of all classes, a list with an entry for each.

    Attributes:
        rows: Those of each row of Table 7.10 by name.
        remaining: Those of Trifuse's fusion by the modalities that remain.
        steps: Those of each step of the fusion by name.
    """

    rows: Mapping[str, Sequence[ClassPrecision]]
    remaining: Mapping[tuple[Modality, ...], Sequence[ClassPrecision]]
    steps: Mapping[str, Sequence[ClassPrecision]]

    def report(self, place: int, reliability: Mapping[str, Reliability]) -> ClassFusionReport:
        """Return the report of the class at a place of the lists."""
        rows = {name: one[place] for name, one in self.rows.items()}
        singles = {
            name: rows[heading] for name, heading in MODALITY_NAMES.items() if heading in rows
        }
        joined = {MODALITY_NAMES[name]: () for name in singles}
        return ClassFusionReport(
            {
                name: FusionRow(one, joined.get(name, tuple(singles.values())))
                for name, one in rows.items()
            },
            {
                "+".join(names): FusionRow(one[place], tuple(singles[name] for name in names))
                for names, one in self.remaining.items()
            },
            {name: one[place] for name, one in self.steps.items()},
            reliability,
        )


@dataclass(kw_only=True)
class FusionMeasure(PrecisionMeasure[LocatedScene]):
    """Accumulates the detections of three detectors frame by frame.

    Attributes:
        fusions: Fusion networks by variant, `default` among them.
    """

    fusions: Mapping[FusionVariant, Fusion]

    def boxes(self) -> EvaluationBoxes:
        """Return the labelled boxes and those of Trifuse's fusion of all frames so far."""
        return self.pair(self._detected(self._fuse))

    def compute(self) -> FusionReport:
        """Return the metrics of all frames so far."""
        scenes = [output.scene for output in self.outputs]
        steps: dict[str, Fuse] = {
            "merged": lambda scene: scene.merged.detections,
            "rescored": partial(_rescore, self.fusions["default"]),
            "rescored and suppressed": self._fuse,
        }
        no_intervals = replace(self.config, bootstrap=0)
        functions = row_functions(scenes, self.fusions)
        detected = {name: self._detected(one) for name, one in functions.items()}
        if any(output.has_bev for output in self.outputs):
            detected[WITH_BEV] = self.detected(lambda output: output.fused.detections)
        modalities = [name for name in MODALITIES if MODALITY_NAMES[name] in detected]
        precision = _Precision(
            rows={name: self.precision(found) for name, found in detected.items()},
            remaining={
                names: self.precision(self._detected(partial(self._fuse_rest, names)))
                for names in remaining_sets(modalities, min_count=1)
                if len(names) < len(modalities)
            },
            steps={n: self.precision(self._detected(s), no_intervals) for n, s in steps.items()},
        )
        reports = {}
        for place, of_class in enumerate(self.classes):
            at_iou = of_class.at_iou(self.config.iou[0])
            reliability = {
                name: measure_reliability(match_correctness(self.pair(found), at_iou), _BINS)
                for name, found in detected.items()
                if name != MERGED
            }
            reports[of_class.name] = precision.report(place, reliability)
        return FusionReport(self._benchmark(), reports)

    def _benchmark(self) -> BenchmarkScores:
        fused = [output.fused for output in self.outputs]
        if any(np.isnan(one.boxes_velo.bottom_m).any() for one in self.labels):  # those of images
            truths = TrueBoxes.of_frames(self.labels)
            found = DetectedBoxes.of_frames([one.detections for one in fused])
        else:
            truths = TrueBoxes.of_frames(self.labels, [one.camera for one in fused])
            found = DetectedBoxes.of_located(fused)
        return measure_benchmark(
            truths, found, len(fused), self.classes, self.config, self.progress
        )

    def _detected(self, fuse: Fuse) -> DetectedBoxes:
        return self.detected(lambda output: fuse(output.scene))

    def _fuse(self, scene: DetectedScene) -> Detections:
        return _fuse(self.fusions["default"], scene)

    def _fuse_rest(self, remaining: Sequence[Modality], scene: DetectedScene) -> Detections:
        return self._fuse(scene.without(*(name for name in MODALITIES if name not in remaining)))


def row_functions(
    scenes: Sequence[DetectedScene], fusions: Mapping[FusionVariant, Fusion]
) -> dict[str, Fuse]:
    """Return what makes the detections of each row from a scene: a modality of all scenes, merged, or fused."""
    rows: dict[str, Fuse] = {
        MODALITY_NAMES[name]: partial(_single_modality, name)
        for name in MODALITIES
        if all(name in scene.modality_detections for scene in scenes)
    }
    rows[MERGED] = _merge
    return rows | {VARIANT_NAMES[name]: partial(_fuse, one) for name, one in fusions.items()}


def _single_modality(name: Modality, scene: DetectedScene) -> Detections:
    return scene.modality_detections[name]


def _merge(scene: DetectedScene) -> Detections:
    return NmsFusion().fuse(scene).detections


def _fuse(fusion: Fusion, scene: DetectedScene) -> Detections:
    return fusion.fuse(scene).detections


def _rescore(fusion: Fusion, scene: DetectedScene) -> Detections:
    has_boxes = len(scene.merged.detections) > 0
    return fusion.rescore(scene).detections if has_boxes else Detections.empty()
