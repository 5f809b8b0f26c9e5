"""Error of the estimated ground against labelled objects (thesis 7.1.1) and against exact point classes.

Two metrics. Labelled boxes stand on the true ground, so the distance of a box's bottom centre from the
estimated surface is an error (Fig. 3.3); this takes any `GroundModel`. Where every point has an exact class,
the points classified as ground are counted against the true ones.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Annotated, Any

import numpy as np

from perception.evaluation.confusion import Confusion, add_confusions, confusion
from perception.evaluation.report import TOTAL, Metric, Metrics, Report, Table, with_total
from perception.geometry.grids import LocalArea
from perception.obstacles.config import PiecewisePlanesConfig
from perception.obstacles.ground_planes import slice_edges_m, slice_starts_m
from perception.sensor import LidarModel
from perception.types import (
    ArrayTable,
    Float,
    Float64,
    GroundModel,
    Int,
    Labels,
    PointState,
    PointTruth,
    Result,
    UInt8,
)

# SemanticKITTI's classes that lie on the ground (semantic-kitti.yaml): road 40, parking 44, sidewalk 48, other ground
# 49, lane marking 60, which its official map for learning joins to road, and terrain 72, grass and soil. Their class decides, not their slope: the face of a kerb is sidewalk, so a kerb called an
# obstacle costs recall. Vegetation is no ground, however low.
GROUND_CLASSES = (40, 44, 48, 49, 60, 72)
UNLABELLED_CLASSES = (0, 1)  # unlabelled, outlier: the official map ignores both

RANGE_EDGES_M = (0.0, 5.0, 10.0, 15.0, 20.0, 25.0)

PROTOCOL = {
    "mDE": (
        "distance along the ground's normal from the bottom centre of each labelled 3D box to the "
        "estimated ground, averaged over the objects of a frame, then over the frames that have any "
        "(7.1)-(7.2); every type but DontCare, bottom centre within the local area"
    ),
    "bias": "the same with signs, positive where the estimated ground lies too low",
    "range": "horizontal distance from the LiDAR",
    "slices": "intervals of x between the edges of (5.2) with the thesis' eta",
    "points": (
        "points classified as ground against points of the classes of the ground (road, parking, sidewalk, "
        "other ground, lane marking, terrain), over the local area, summed over frames; unlabelled points "
        "and outliers do not count, the faces of kerbs are ground"
    ),
    "ground_classes": GROUND_CLASSES,
}


@dataclass(frozen=True)
class GroundErrors(ArrayTable):
    """Errors at the bottom centres of K labelled objects, of one frame or of many.

    Attributes:
        frames: (K,) Number of the frame.
        bottom_centers_m: (K, 2) x and y of the bottom centre in the LiDAR frame.
        errors_m: (K,) Signed error, positive where the estimated ground lies too low.
    """

    frames: Int
    bottom_centers_m: Annotated[Float64, 2]
    errors_m: Float64

    @property
    def ranges_m(self) -> Float64:
        """(K,) horizontal distance of the bottom centre from the LiDAR."""
        return np.asarray(np.linalg.norm(self.bottom_centers_m, axis=-1))


def ground_errors(
    frame: int, ground: GroundModel, bottom_centers: Float, area: LocalArea
) -> GroundErrors:
    """Measure one frame at the (K, 3) bottom centres of its labelled objects that are in the area."""
    inside = bottom_centers[area.contains_xy(bottom_centers)]
    return GroundErrors(
        frames=np.full(len(inside), frame, np.int64),
        bottom_centers_m=inside[:, :2].astype(np.float64),
        errors_m=np.asarray(ground.distance_m(inside), np.float64),
    )


@dataclass(frozen=True)
class MeanDisplacementError(Metrics):
    """Mean displacement error, and the number of frames and objects that it rests on.

    Attributes:
        mde_m: Mean over the frames of each frame's mean over its objects (7.1)-(7.2); NaN without any.
        bias_m: The same mean of signed errors, positive where the estimated ground lies too low.
        frames: Number of frames that have an object.
        objects: Number of objects in all frames.
    """

    mde_m: Annotated[float, Metric("mDE [m]", ".4f")]
    bias_m: Annotated[float, Metric("bias [m]", "+.4f")]
    frames: Annotated[int, Metric("frames")]
    objects: Annotated[int, Metric("objects")]


def mean_displacement_error(errors: GroundErrors) -> MeanDisplacementError:
    """Average first within each frame, then over the frames that have an object (7.1)-(7.2)."""
    frames, frame_of_object = np.unique(errors.frames, return_inverse=True)
    if len(frames) == 0:
        return MeanDisplacementError(float("nan"), float("nan"), 0, 0)
    objects = np.bincount(frame_of_object)
    return MeanDisplacementError(
        mde_m=float(np.mean(np.bincount(frame_of_object, np.abs(errors.errors_m)) / objects)),
        bias_m=float(np.mean(np.bincount(frame_of_object, errors.errors_m) / objects)),
        frames=len(frames),
        objects=len(errors),
    )


def pooled_displacement_error(parts: Iterable[MeanDisplacementError]) -> MeanDisplacementError:
    """Average over the frames of all parts, such as the sequences of Table 3.1 (7.2)."""
    known = [part for part in parts if part.frames]
    frames = sum(part.frames for part in known)
    if not frames:
        return MeanDisplacementError(float("nan"), float("nan"), 0, 0)
    return MeanDisplacementError(
        mde_m=sum(part.mde_m * part.frames for part in known) / frames,
        bias_m=sum(part.bias_m * part.frames for part in known) / frames,
        frames=frames,
        objects=sum(part.objects for part in known),
    )


def displacement_by_interval(
    errors: GroundErrors, positions_m: Float64, edges_m: Sequence[float]
) -> dict[str, MeanDisplacementError]:
    """Return the error in each interval between rising edges, and beyond the last edge.

    Args:
        errors: Errors of K objects.
        positions_m: (K,) Range of each object, or its x for slices (5.2), which end at lines of x.
        edges_m: Rising edges of the intervals.
    """
    interval = _interval_of(positions_m, edges_m)
    return {
        name: mean_displacement_error(errors[interval == number])
        for number, name in enumerate(interval_names(edges_m))
    }


def interval_names(edges_m: Sequence[float]) -> list[str]:
    """Name the intervals between rising edges, and the one beyond the last edge."""
    bounded = [f"{low:.4g} to {high:.4g} m" for low, high in pairwise(edges_m)]
    return [*bounded, f"over {edges_m[-1]:.4g} m"]


def ground_confusion(
    points_velo: Float, states: UInt8, classes: Int, area: LocalArea
) -> dict[str, Confusion]:
    """Compare the points classified as ground with the true ones, for each interval of horizontal range.

    All labelled points over the area count, whatever their height: a true ground point that was left out
    as too low or too high is a missed one.
    """
    counts = area.contains_xy(points_velo) & ~np.isin(classes, UNLABELLED_CLASSES)
    points, states, classes = points_velo[counts], states[counts], classes[counts]
    predicted = np.asarray(states == PointState.GROUND)
    target = np.isin(classes, GROUND_CLASSES)
    interval = _interval_of(np.hypot(points[:, 0], points[:, 1]), RANGE_EDGES_M)
    return {
        name: confusion(predicted[interval == number], target[interval == number])
        for number, name in enumerate(interval_names(RANGE_EDGES_M))
    }


def _interval_of(ranges_m: Float, edges_m: Sequence[float]) -> Int:
    """Return 0 between the first two edges, and so on; -1 below the first."""
    return np.asarray(np.searchsorted(np.asarray(edges_m), ranges_m, side="right") - 1)


@dataclass(frozen=True)
class GroundReport(Report):
    """Metrics of the ground of one drive.

    Attributes:
        mde: Error over all objects; None without labels.
        mde_by_range: Error by horizontal range.
        mde_by_slice: Error by the thesis' slices.
        points: Confusion of all ground points; None without exact truth.
        points_by_range: Confusion of ground points by horizontal range.
    """

    mde: MeanDisplacementError | None = None
    mde_by_range: Mapping[str, MeanDisplacementError] = field(default_factory=dict)
    mde_by_slice: Mapping[str, MeanDisplacementError] = field(default_factory=dict)
    points: Confusion | None = None
    points_by_range: Mapping[str, Confusion] = field(default_factory=dict)

    def tables(self) -> list[Table[Any]]:
        """Return the errors by range and by slice, and the confusion of points."""
        tables: list[Table[Any]] = []
        if self.mde is not None:
            columns, by_range = (
                MeanDisplacementError.columns(),
                {"all": self.mde, **self.mde_by_range},
            )
            tables.append(Table("Ground at labelled bottom centres, by range", columns, by_range))
            tables.append(Table("The same by slices of x (5.2)", columns, self.mde_by_slice))
        if self.points is not None:
            points = {"all": self.points, **self.points_by_range}
            title = "Ground points against exact truth"
            tables.append(Table(title, Confusion.columns(), points))
        return tables


@dataclass(frozen=True)
class GroundSetReport(Report):
    """Metrics of the ground of several sequences.

    Attributes:
        sequences: Metrics of each sequence, by its name.
        printed_mde_m: Mean displacement error over all sequences of the set that the thesis prints.
    """

    sequences: Mapping[str, GroundReport]
    printed_mde_m: float

    @property
    def total(self) -> MeanDisplacementError:
        """Error over the frames of all sequences (7.2)."""
        return pooled_displacement_error(self._errors.values())

    def tables(self) -> list[Table[Any]]:
        """Return the errors by sequence, and the confusions of points where truth is exact."""
        printed = f"Thesis (Fig. 7.1): mDE {self.printed_mde_m:g} m over all sequences of the set."
        errors = Table(
            "Ground at labelled bottom centres, by sequence",
            MeanDisplacementError.columns(),
            {**self._errors, TOTAL: self.total},
            heading="sequence",
            notes=("", printed),
        )
        points = {n: one.points for n, one in self.sequences.items() if one.points is not None}
        if not points:
            return [errors]
        title = "Ground points against exact truth, by sequence"
        return [errors, Table(title, Confusion.columns(), with_total(points), heading="sequence")]

    def to_json(self) -> dict[str, Any]:
        """Return the metrics by sequence, their total, and the printed error."""
        sequences = {name: report.to_json() for name, report in self.sequences.items()}
        thesis = {"mde_m": self.printed_mde_m}
        return {"sequences": sequences, "total": self.total.to_json(), "thesis": thesis}

    @property
    def _errors(self) -> dict[str, MeanDisplacementError]:
        return {n: one.mde for n, one in self.sequences.items() if one.mde is not None}


class GroundMeasure:
    """Accumulates the errors of the estimated ground over the frames of a drive."""

    def __init__(self, sensor: LidarModel, area: LocalArea) -> None:
        """Start without a frame.

        Args:
            sensor: LiDAR model of the drive, of which the thesis' slices follow.
            area: Area over which objects and points count.
        """
        self._area, self._slice_edges_m = area, _thesis_slice_edges_m(sensor, area)
        self._errors: list[GroundErrors] = []
        self._points: dict[str, Confusion] = {}

    def update(self, result: Result, labels: Labels | None, truth: PointTruth | None) -> None:
        """Add one frame."""
        if labels is not None:
            bottom_m = labels.boxes_velo.bottom_m
            index = result.frame.index
            self._errors.append(ground_errors(index, result.ground, bottom_m, self._area))
        if truth is not None:
            states, points = result.obstacles.point_states, result.frame.points_velo
            added = ground_confusion(points, states, truth.classes, self._area)
            self._points = add_confusions(self._points, added)

    def compute(self) -> GroundReport:
        """Return the metrics of all frames so far."""
        points = sum(self._points.values(), Confusion()) if self._points else None
        if not self._errors:
            return GroundReport(points=points, points_by_range=self._points)
        errors = GroundErrors.concatenate(self._errors)
        along_x_m = errors.bottom_centers_m[:, 0]
        return GroundReport(
            mean_displacement_error(errors),
            displacement_by_interval(errors, errors.ranges_m, RANGE_EDGES_M),
            displacement_by_interval(errors, along_x_m, self._slice_edges_m),
            points,
            self._points,
        )


def _thesis_slice_edges_m(sensor: LidarModel, area: LocalArea) -> list[float]:
    """Return the rising edges in x of the thesis' slices (5.2) for a sensor."""
    edges_m = slice_edges_m(
        sensor.height_m, sensor.elevation_step_rad, area.ahead_m, PiecewisePlanesConfig()
    )
    return [-area.behind_m, *slice_starts_m(edges_m, area.ahead_m).tolist()]
