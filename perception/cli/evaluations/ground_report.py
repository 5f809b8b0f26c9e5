"""`trifuse evaluate ground`, below the flags: gather over a drive, make figures, print them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from perception.cli.confusion_table import confusion_metrics, confusion_table
from perception.cli.table import Cell, format_table
from perception.evaluation.confusion import Confusion
from perception.evaluation.ground import (
    GROUND_CLASSES,
    RANGE_EDGES_M,
    GroundErrors,
    LabelledScan,
    MeanDisplacementError,
    displacement_by_interval,
    ground_confusion,
    ground_errors,
    interval_names,
    mean_displacement_error,
)
from perception.geometry.grids import LocalArea
from perception.obstacles.ground_planes import PiecewisePlanesConfig, slice_edges_m, slice_starts_m
from perception.types import Drive, Result

PROTOCOL = {
    "mDE": (
        "distance along the ground's normal from the bottom centre of each labelled 3D box to the "
        "estimated ground, averaged over the objects of a frame, then over the frames that have any "
        "(7.1)-(7.2); every type but DontCare, base within the local area"
    ),
    "bias": "the same with signs, positive where the estimated ground lies too low",
    "range": "horizontal distance from the LiDAR",
    "slices": "intervals of x between the edges of (5.2) with the thesis' eta",
    "points": (
        "points called ground against points of the classes of the ground, over the local area, summed "
        "over frames; unlabelled points do not count, the faces of kerbs are ground"
    ),
    "ground_classes": GROUND_CLASSES,
}


@dataclass(frozen=True)
class GroundReport:
    """Everything measured of the ground of one drive.

    Attributes:
        frames: evaluated.
        slice_edges_m: of the thesis' slices for the drive's sensor.
        feet: errors at labelled objects, or None without labels.
        points: counts by interval of range, or None without exact truth.
    """

    frames: int
    slice_edges_m: Sequence[float]
    feet: GroundErrors | None
    points: list[Confusion] | None

    @property
    def total(self) -> MeanDisplacementError | None:
        """The figure of the whole drive."""
        return None if self.feet is None else mean_displacement_error(self.feet)

    def by_range(self) -> dict[str, MeanDisplacementError]:
        """Return the figures by horizontal range."""
        return self._by_interval(RANGE_EDGES_M, along_x=False)

    def by_slice(self) -> dict[str, MeanDisplacementError]:
        """Return the figures by the thesis' slices."""
        return self._by_interval(self.slice_edges_m, along_x=True)

    def points_by_range(self) -> dict[str, Confusion]:
        """Return the counts of points by horizontal range."""
        names = interval_names(RANGE_EDGES_M)
        return {} if self.points is None else dict(zip(names, self.points, strict=True))

    def _by_interval(
        self, edges_m: Sequence[float], *, along_x: bool
    ) -> dict[str, MeanDisplacementError]:
        if self.feet is None:
            return {}
        positions_m = self.feet.bottom_centers_m[:, 0] if along_x else self.feet.ranges_m
        metrics = displacement_by_interval(self.feet, positions_m, edges_m)
        return dict(zip(interval_names(edges_m), metrics, strict=True))


def measure_ground(drive: Drive, results: Iterable[Result], area: LocalArea) -> GroundReport:
    """Compare the ground of each result with the labels and, where it is known, the truth of its frame."""
    feet: list[GroundErrors] = []
    points: list[list[Confusion]] = []
    frames = 0
    for result in results:
        frames += 1
        index = result.frame.index
        if drive.has_labels:
            bottom_m = drive.labels(index).boxes_velo.bottom_m
            feet.append(ground_errors(index, result.ground, bottom_m, area))
        truth = drive.point_truth(index)
        if truth is not None:
            states = result.obstacles.point_states
            scan = LabelledScan(result.frame.points_velo, states, truth.classes)
            points.append(ground_confusion(scan, area))
    return GroundReport(
        frames=frames,
        slice_edges_m=_thesis_edges_m(drive, area),
        feet=GroundErrors.concatenate(feet) if feet else None,
        points=_sum_by_range(points) if points else None,
    )


def _thesis_edges_m(drive: Drive, area: LocalArea) -> list[float]:
    sensor = drive.sensor
    edges_m = slice_edges_m(
        sensor.height_m, sensor.elevation_step_rad, area.ahead_m, PiecewisePlanesConfig()
    )
    return [-area.behind_m, *slice_starts_m(edges_m, area.ahead_m).tolist()]


def _sum_by_range(points: list[list[Confusion]]) -> list[Confusion]:
    return [sum(frames, Confusion()) for frames in zip(*points, strict=True)]


def ground_tables(report: GroundReport) -> str:
    """Return the figures for people."""
    tables = []
    if report.total is not None:
        by_range = {"all": report.total, **report.by_range()}
        tables.append(_displacement_table("Ground at the feet of labelled objects", by_range))
        tables.append(_displacement_table("The same by slices of x (5.2)", report.by_slice()))
    if report.points is not None:
        points = {"all": sum(report.points, Confusion()), **report.points_by_range()}
        tables.append(confusion_table("Points called ground, against exact truth", points))
    return "\n\n".join(tables)


def _displacement_table(title: str, metrics: dict[str, MeanDisplacementError]) -> str:
    rows: list[list[Cell]] = [
        [name, f"{metric.mde_m:.4f}", f"{metric.bias_m:+.4f}", metric.frames, metric.objects]
        if metric.objects
        else [name, None, None, 0, 0]
        for name, metric in metrics.items()
    ]
    return format_table(title, ("", "mDE [m]", "bias [m]", "frames", "objects"), rows)


def ground_results(report: GroundReport) -> dict[str, Any]:
    """Return the figures for programs."""
    results: dict[str, Any] = {}
    if report.total is not None:
        results["mde"] = report.total
        results["mde_by_range"] = report.by_range()
        results["mde_by_slice"] = report.by_slice()
    if report.points is not None:
        results["points"] = confusion_metrics(sum(report.points, Confusion()))
        by_range = report.points_by_range()
        results["points_by_range"] = {name: confusion_metrics(by_range[name]) for name in by_range}
    return results
