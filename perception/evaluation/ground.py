"""Error of the estimated ground against labelled objects (thesis 7.1.1) and against exact point classes.

Two metrics. Labelled boxes stand on the true ground, so the distance of a box's bottom centre from the
estimated surface is an error (Fig. 3.3); this takes any `GroundModel`. Where every point has an exact class,
the points classified as ground are counted against the true ones.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any

import numpy as np

from perception.evaluation.confusion import Confusion, confusion, confusion_table
from perception.evaluation.report import Column, Table
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

# SemanticKITTI's classes that lie on the ground: road, parking, sidewalk, other ground, lane marking,
# terrain. Their class decides, not their slope: the face of a kerb is sidewalk, so a kerb called an
# obstacle costs recall. Vegetation is no ground, however low.
GROUND_CLASSES = (40, 44, 48, 49, 60, 72)
UNLABELLED_CLASSES = (0, 1)  # unlabelled, outlier: neither right nor wrong

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
        "points classified as ground against points of the classes of the ground, over the local area, "
        "summed over frames; unlabelled points do not count, the faces of kerbs are ground"
    ),
    "ground_classes": GROUND_CLASSES,
}


def signed_errors(ground: GroundModel, bottom_centers: Float) -> Float64:
    """Return (K,) distances along the ground's normal: positive where the estimate lies too low."""
    if len(bottom_centers) == 0:
        return np.zeros(0)
    return np.asarray(ground.distance_m(bottom_centers), np.float64)


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
        errors_m=signed_errors(ground, inside),
    )


@dataclass(frozen=True)
class MeanDisplacementError:
    """Mean displacement error, and the number of frames and objects that it rests on.

    Attributes:
        mde_m: Mean over the frames of each frame's mean over its objects (7.1)-(7.2); NaN without any.
        bias_m: The same mean of signed errors, positive where the estimated ground lies too low.
        frames: Number of frames that have an object.
        objects: Number of objects in all frames.
    """

    mde_m: float
    bias_m: float
    frames: int
    objects: int


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


def displacement_by_interval(
    errors: GroundErrors, positions_m: Float64, edges_m: Sequence[float]
) -> list[MeanDisplacementError]:
    """Return the error in each interval between rising edges, and beyond the last edge.

    Args:
        errors: Errors of K objects.
        positions_m: (K,) Range of each object, or its x for slices (5.2), which end at lines of x.
        edges_m: Rising edges of the intervals.
    """
    interval = _interval_of(positions_m, edges_m)
    return [mean_displacement_error(errors[interval == number]) for number in range(len(edges_m))]


def interval_names(edges_m: Sequence[float]) -> list[str]:
    """Name the intervals between rising edges, and the one beyond the last edge."""
    bounded = [f"{low:.4g} to {high:.4g} m" for low, high in pairwise(edges_m)]
    return [*bounded, f"over {edges_m[-1]:.4g} m"]


def ground_confusion(
    points_velo: Float, states: UInt8, classes: Int, area: LocalArea
) -> list[Confusion]:
    """Compare the points classified as ground with the true ones, for each interval of horizontal range.

    All labelled points over the area count, whatever their height: a true ground point that was left out
    as too low or too high is a missed one.
    """
    counts = area.contains_xy(points_velo) & ~np.isin(classes, UNLABELLED_CLASSES)
    points, states, classes = points_velo[counts], states[counts], classes[counts]
    predicted = np.asarray(states == PointState.GROUND)
    target = np.isin(classes, GROUND_CLASSES)
    interval = _interval_of(np.hypot(points[:, 0], points[:, 1]), RANGE_EDGES_M)
    rows = [interval == number for number in range(len(RANGE_EDGES_M))]
    return [confusion(predicted[row], target[row]) for row in rows]


def _interval_of(ranges_m: Float, edges_m: Sequence[float]) -> Int:
    """Return 0 between the first two edges, and so on; -1 below the first."""
    return np.asarray(np.searchsorted(np.asarray(edges_m), ranges_m, side="right") - 1)


_COLUMNS = (
    Column[MeanDisplacementError]("mDE [m]", lambda e: e.mde_m, ".4f", "mde_m"),
    Column[MeanDisplacementError]("bias [m]", lambda e: e.bias_m, "+.4f", "bias_m"),
    Column[MeanDisplacementError]("frames", lambda e: e.frames, "", "frames"),
    Column[MeanDisplacementError]("objects", lambda e: e.objects, "", "objects"),
)


@dataclass(frozen=True)
class GroundReport:
    """Metrics of the ground of one drive.

    Attributes:
        total: Error over all objects, or None without labels.
        by_range: Error by horizontal range.
        by_slice: Error by the thesis' slices.
        points: Confusion of ground points by horizontal range; empty without exact truth.
    """

    total: MeanDisplacementError | None
    by_range: Mapping[str, MeanDisplacementError]
    by_slice: Mapping[str, MeanDisplacementError]
    points: Mapping[str, Confusion]

    @property
    def all_points(self) -> Confusion:
        """Confusion of all ground points."""
        return sum(self.points.values(), Confusion())

    def tables(self) -> list[Table[Any]]:
        """Return the errors by range and by slice, and the confusion of points."""
        tables: list[Table[Any]] = []
        if self.total is not None:
            by_range = {"all": self.total, **self.by_range}
            tables.append(Table("Ground at labelled bottom centres, by range", _COLUMNS, by_range))
            tables.append(Table("The same by slices of x (5.2)", _COLUMNS, self.by_slice))
        if self.points:
            points = {"all": self.all_points, **self.points}
            tables.append(confusion_table("Ground points against exact truth", points))
        return tables

    def to_json(self) -> dict[str, Any]:
        """Return the errors and the confusion of points by name."""
        document: dict[str, Any] = {}
        if self.total is not None:
            document["mde"] = self.total
            document["mde_by_range"] = self.by_range
            document["mde_by_slice"] = self.by_slice
        if self.points:
            document["points"] = self.all_points.to_json()
            document["points_by_range"] = {n: one.to_json() for n, one in self.points.items()}
        return document


class GroundMeasure:
    """Accumulates the errors of the estimated ground over the frames of a drive."""

    def __init__(self, area: LocalArea, slice_edges_m: Sequence[float]) -> None:
        """Start without a frame.

        Args:
            area: Area over which objects and points count.
            slice_edges_m: Rising edges in x of the slices that errors are grouped by.
        """
        self._area, self._slice_edges_m = area, slice_edges_m
        self._errors: list[GroundErrors] = []
        self._points: list[list[Confusion]] = []

    def update(self, result: Result, labels: Labels | None, truth: PointTruth | None) -> None:
        """Add one frame."""
        if labels is not None:
            bottom_m = labels.boxes_velo.bottom_m
            index = result.frame.index
            self._errors.append(ground_errors(index, result.ground, bottom_m, self._area))
        if truth is not None:
            states = result.obstacles.point_states
            points = result.frame.points_velo
            self._points.append(ground_confusion(points, states, truth.classes, self._area))

    def compute(self) -> GroundReport:
        """Return the metrics of all frames so far."""
        points = [sum(interval, Confusion()) for interval in zip(*self._points, strict=True)]
        by_points = dict(zip(interval_names(RANGE_EDGES_M), points, strict=True)) if points else {}
        if not self._errors:
            return GroundReport(None, {}, {}, by_points)
        errors = GroundErrors.concatenate(self._errors)
        along_x_m = errors.bottom_centers_m[:, 0]
        return GroundReport(
            total=mean_displacement_error(errors),
            by_range=_named(errors, errors.ranges_m, RANGE_EDGES_M),
            by_slice=_named(errors, along_x_m, self._slice_edges_m),
            points=by_points,
        )


def _named(
    errors: GroundErrors, positions_m: Float64, edges_m: Sequence[float]
) -> dict[str, MeanDisplacementError]:
    metrics = displacement_by_interval(errors, positions_m, edges_m)
    return dict(zip(interval_names(edges_m), metrics, strict=True))


def thesis_slice_edges_m(sensor: LidarModel, area: LocalArea) -> list[float]:
    """Return the rising edges in x of the thesis' slices (5.2) for a sensor."""
    edges_m = slice_edges_m(
        sensor.height_m, sensor.elevation_step_rad, area.ahead_m, PiecewisePlanesConfig()
    )
    return [-area.behind_m, *slice_starts_m(edges_m, area.ahead_m).tolist()]
