"""How far the estimated ground is from the true one (thesis 7.1.1), and which points it rightly claims.

Two measures. Where objects are labelled, their boxes stand on the true ground, so that the distance
of a box's bottom centre to the estimated surface is an error (Fig. 3.3); any `GroundModel` can be
asked, whoever made it. Where every point has an exact class, the points called ground are counted.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from perception.evaluation.confusion import Confusion, confusion
from perception.evaluation.rows import Rows
from perception.geometry.grids import LocalArea
from perception.types import Float, Float64, GroundModel, Int, PointState, UInt8

# SemanticKITTI's classes that lie on the ground: road, parking, sidewalk, other ground, lane marking,
# terrain. Their class decides, not their slope: the face of a kerb is sidewalk, so a kerb called an
# obstacle costs recall. Vegetation is no ground, however low.
GROUND_CLASSES = (40, 44, 48, 49, 60, 72)
UNLABELLED_CLASSES = (0, 1)  # unlabelled, outlier: neither right nor wrong

RANGE_EDGES_M = (0.0, 5.0, 10.0, 15.0, 20.0, 25.0)


def displacement_errors(ground: GroundModel, bottom_centers: Float) -> Float64:
    """Return (K,) distances |(p_k - p) . n| of (K, 3) true ground points from the ground (7.1)."""
    return np.abs(signed_errors(ground, bottom_centers))


def signed_errors(ground: GroundModel, bottom_centers: Float) -> Float64:
    """Return (K,) distances along the ground's normal: positive where the estimate lies too low."""
    if len(bottom_centers) == 0:
        return np.zeros(0)
    return np.asarray(ground.distance_m(bottom_centers), np.float64)


@dataclass(frozen=True)
class GroundErrors(Rows):
    """The errors at the feet of K labelled objects, of one frame or of many.

    Attributes:
        frames: (K,) number of the frame.
        bottom_centers_m: (K, 2) x and y of the foot in the LiDAR frame.
        errors_m: (K,) signed: positive where the estimated ground lies too low.
    """

    frames: Int
    bottom_centers_m: Float64
    errors_m: Float64

    @property
    def ranges_m(self) -> Float64:
        """(K,) horizontal distance of the foot from the LiDAR."""
        return np.asarray(np.linalg.norm(self.bottom_centers_m, axis=-1))


def ground_errors(
    frame: int, ground: GroundModel, bottom_centers: Float, area: LocalArea
) -> GroundErrors:
    """Measure one frame at the (K, 3) feet of its labelled objects, as far as they are in the area."""
    feet = bottom_centers[area.contains_xy(bottom_centers)]
    return GroundErrors(
        frames=np.full(len(feet), frame, np.int64),
        bottom_centers_m=feet[:, :2].astype(np.float64),
        errors_m=signed_errors(ground, feet),
    )


@dataclass(frozen=True)
class MeanDisplacementError:
    """The mean of displacement errors, and what it rests on.

    Attributes:
        mde_m: mean over the frames of each frame's mean over its objects (7.1)-(7.2); NaN without any.
        bias_m: the same with signs: positive where the estimated ground lies too low.
        frames: that have an object.
        objects: in all frames.
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
    """Return one figure for each interval between rising edges, and one for what lies beyond the last.

    Args:
        errors: of K objects.
        positions_m: (K,) where each lies: its range, or its x for slices (5.2), which end at lines of x.
        edges_m: of the intervals.
    """
    interval = _interval_of(positions_m, edges_m)
    return [mean_displacement_error(errors[interval == number]) for number in range(len(edges_m))]


def interval_names(edges_m: Sequence[float]) -> list[str]:
    """Name the intervals between rising edges, and what lies beyond the last."""
    bounded = [f"{low:.4g} to {high:.4g} m" for low, high in pairwise(edges_m)]
    return [*bounded, f"over {edges_m[-1]:.4g} m"]


@dataclass(frozen=True)
class LabelledScan:
    """What was said of the N points of one scan, and what is true.

    Attributes:
        points_velo: (N, 3+).
        states: (N,) one `PointState` each.
        classes: (N,) SemanticKITTI's class numbers.
    """

    points_velo: Float
    states: UInt8
    classes: Int


def ground_confusion(
    scan: LabelledScan, area: LocalArea, edges_m: Sequence[float] = RANGE_EDGES_M
) -> list[Confusion]:
    """Compare the points called ground with the true ones, for each interval of horizontal range.

    All labelled points over the area count, whatever their height: a true ground point that was taken
    for too low or too high to matter is a missed one.
    """
    counts = area.contains_xy(scan.points_velo) & ~np.isin(scan.classes, UNLABELLED_CLASSES)
    points, states, classes = scan.points_velo[counts], scan.states[counts], scan.classes[counts]
    predicted = np.asarray(states == PointState.GROUND)
    target = np.isin(classes, GROUND_CLASSES)
    interval = _interval_of(np.hypot(points[:, 0], points[:, 1]), edges_m)
    rows = [interval == number for number in range(len(edges_m))]
    return [confusion(predicted[row], target[row]) for row in rows]


def _interval_of(ranges_m: Float, edges_m: Sequence[float]) -> Int:
    """Return 0 between the first two edges, and so on; -1 below the first."""
    return np.asarray(np.searchsorted(np.asarray(edges_m), ranges_m, side="right") - 1)
