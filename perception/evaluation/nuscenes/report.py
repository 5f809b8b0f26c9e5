"""Metrics of nuScenes' detection task: AP and errors of each class, their means, and NDS."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

import numpy as np

from perception.evaluation.nuscenes.boxes import Surroundings, TaskDetections, TaskObjects
from perception.evaluation.nuscenes.precision import ClassCurves, measure_class
from perception.evaluation.nuscenes.protocol import CLASSES, DISTANCES_M, ERRORS, MEAN_AP_WEIGHT
from perception.evaluation.report import CONTEXT, Column, Metric, Metrics, Report, Table
from perception.render.curve_plots import CurvePanel, precision_panel

MEAN = "mean"


@dataclass(frozen=True)
class SampleObjects:
    """Objects and detections of one sample.

    Attributes:
        truths: Labelled objects.
        found: Detected objects.
        surroundings: What tells which of them count.
    """

    truths: TaskObjects
    found: TaskDetections
    surroundings: Surroundings


@dataclass(frozen=True)
class TaskMetrics(Metrics):
    """Metrics of one class, or the means of all.

    Attributes:
        objects: Number of objects that count.
        detections: Number of detections that count.
        ap_by_distance: Average precision at each distance in m, 0 to 1.
        trans_err: Distance of the centres over the ground in m.
        scale_err: 1 - IoU of the boxes with centres and headings aligned.
        orient_err: Error of the heading in rad.
        vel_err: Error of the velocity in m/s.
        attr_err: Share of wrong attributes.
    """

    objects: Annotated[int, Metric("objects")]
    detections: Annotated[int, Metric("detections")]
    ap_by_distance: Annotated[Mapping[str, float], CONTEXT]
    trans_err: Annotated[float, Metric("ATE [m]", ".3f")]
    scale_err: Annotated[float, Metric("ASE", ".3f")]
    orient_err: Annotated[float, Metric("AOE [rad]", ".3f")]
    vel_err: Annotated[float, Metric("AVE [m/s]", ".3f")]
    attr_err: Annotated[float, Metric("AAE", ".3f")]

    @property
    def mean_ap(self) -> Annotated[float, Metric("AP [%]", ".1%")]:
        """Mean of the average precision over the distances, 0 to 1."""
        return float(np.mean(list(self.ap_by_distance.values())))

    @property
    def errors(self) -> dict[str, float]:
        """Errors of the true positives by name; NaN of those that the class does not have."""
        return {name: getattr(self, name) for name in ERRORS}

    def to_json(self) -> dict[str, Any]:
        """Return the fields and the declared properties by name, AP by distance as `AP`."""
        return {**super().to_json(), "AP": self.ap_by_distance}


@dataclass(frozen=True)
class TaskReport(Report):
    """Metrics of the detection task.

    Attributes:
        title: Title of the table.
        classes: Metrics by class.
        precision: (4, 101) precision by class, at each distance over recall.
    """

    title: Annotated[str, CONTEXT]
    classes: Mapping[str, TaskMetrics]
    precision: Annotated[Mapping[str, Any], CONTEXT]

    @property
    def mean_ap(self) -> Annotated[float, Metric("mAP [%]", ".1%")]:
        """Mean of the average precision over classes and distances, 0 to 1."""
        return self.mean.mean_ap

    @property
    def tp_errors(self) -> Annotated[Mapping[str, float], Metric("errors")]:
        """Mean of each error over the classes that have it."""
        return self.mean.errors

    @property
    def nd_score(self) -> Annotated[float, Metric("NDS [%]", ".1%")]:
        """NDS, 0 to 1: mAP weighed as five scores, and a score of each error."""
        scores = sum(max(1 - error, 0.0) for error in self.tp_errors.values())
        return (MEAN_AP_WEIGHT * self.mean_ap + scores) / (MEAN_AP_WEIGHT + len(ERRORS))

    @property
    def mean(self) -> TaskMetrics:
        """Sums of the counts, and means over the classes."""
        rows = self.classes.values()
        return TaskMetrics(
            sum(one.objects for one in rows),
            sum(one.detections for one in rows),
            {at: _mean([one.ap_by_distance[at] for one in rows]) for at in _distance_names()},
            *(_mean([one.errors[name] for one in rows]) for name in ERRORS),
        )

    def tables(self) -> list[Table[Any]]:
        """Return a row for each class and one for the means, with NDS below."""
        objects, detections, *errors, ap = TaskMetrics.columns()
        at = [
            Column[TaskMetrics](f"{name} m", partial(_ap_at, name), ".1%")
            for name in _distance_names()
        ]
        columns = [objects, detections, ap, *at, *errors]
        notes = [f"NDS {100 * self.nd_score:.1f} %, mAP {100 * self.mean_ap:.1f} %"]
        absent = [name for name, one in self.classes.items() if not one.objects]
        if absent:
            notes.append(
                f"{', '.join(absent)}: no labelled object, which counts as AP 0, errors 1."
            )
        return [Table(self.title, columns, {**self.classes, MEAN: self.mean}, "class", notes)]

    def panels(self) -> list[CurvePanel]:
        """Return the precision-recall curves, a panel for each class with objects."""
        return [
            precision_panel(
                f"{name}, {one.objects} objects",
                {
                    f"{at} m: {100 * ap:.1f} %": curve
                    for (at, ap), curve in zip(
                        one.ap_by_distance.items(), self.precision[name], strict=True
                    )
                },
                "average precision",
            )
            for name, one in self.classes.items()
            if one.objects
        ]


def measure_task(title: str, samples: Sequence[SampleObjects]) -> TaskReport:
    """Measure the detections of some samples; of equal scores, those of the last sample come first.

    Args:
        title: Title of the table.
        samples: Samples in the order of their results.
    """
    truths, truth_samples = [TaskObjects.empty()], []
    found, found_samples = [TaskDetections.empty()], []
    is_in_view = [np.zeros(0, np.bool_)]
    for number, one in enumerate(samples):
        truths.append(one.truths[one.surroundings.count(one.truths) & one.truths.has_points])
        nearby = one.found[one.surroundings.count(one.found)]
        found.append(nearby[one.surroundings.reach_into_view(nearby)])
        is_in_view.append(one.surroundings.are_in_view(found[-1]))
        truth_samples += [number] * len(truths[-1])
        found_samples += [number] * len(found[-1])
    true, detected = TaskObjects.concatenate(truths), TaskDetections.concatenate(found)
    of_true, of_detected = np.array(truth_samples, np.int64), np.array(found_samples, np.int64)
    in_view = np.concatenate(is_in_view)
    classes, precision = {}, {}
    for name, rule in CLASSES.items():
        rows, found_rows = true.types == name, detected.types == name
        curves = measure_class(
            true[rows],
            of_true[rows],
            detected[found_rows],
            of_detected[found_rows],
            rule,
            in_view[found_rows],
        )
        classes[name] = _metrics(int(rows.sum()), int(found_rows.sum()), curves)
        precision[name] = curves.precision
    return TaskReport(title, classes, precision)


def _metrics(objects: int, detections: int, curves: ClassCurves) -> TaskMetrics:
    ap = dict(zip(_distance_names(), curves.ap.tolist(), strict=True))
    return TaskMetrics(objects, detections, ap, *curves.errors.tolist())


def _ap_at(distance: str, row: TaskMetrics) -> float:
    return row.ap_by_distance[distance]


def _distance_names() -> list[str]:
    return [str(distance_m) for distance_m in DISTANCES_M]


def _mean(values: Sequence[float]) -> float:
    """Return the mean of those that are known."""
    return float(np.nanmean(values))
