"""How often the truth lies within the intervals of a reported covariance."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from perception.evaluation.report import Metric, Metrics
from perception.geometry.box_overlap import iou_bev
from perception.geometry.se3 import wrap
from perception.types import ArrayTable, Bool, Boxes3D, Float64, Int, Tracks, Vehicles

Errors = TypeVar("Errors", bound=ArrayTable)

# Share of the errors that the interval should hold.
LEVEL = 0.9
_WITHIN = float(norm.ppf((1 + LEVEL) / 2))  # standard deviations from the mean that hold the level


@dataclass(frozen=True)
class BoxIntervals(ArrayTable):
    """Errors of N boxes of detected true objects in standard deviations; NaN where the deviation is not known.

    Attributes:
        types: (N,) True class.
        range_m: (N,) Distance from the LiDAR to the true centre over the ground.
        is_apart: (N,) Whether the box does not touch the true one from above: it is that of another object.
        center_spread: (N,) Squared Mahalanobis distance of the centres over the ground.
        size_off: (N, 3) Absolute errors of length, width and height.
        axis_off: (N,) Absolute error of the heading modulo pi.
        is_reversed: (N,) Whether the reported front is nearer to the true rear.
        reversal: (N,) Reported probability of that.
    """

    types: NDArray[np.str_]
    range_m: Float64
    is_apart: Bool
    center_spread: Float64
    size_off: Annotated[Float64, 3]
    axis_off: Float64
    is_reversed: Bool
    reversal: Float64

    def summary(self) -> "BoxIntervalMetrics":
        """Return the shares within the intervals of the boxes that are of their object."""
        own = self[~self.is_apart]
        return BoxIntervalMetrics(
            len(self),
            _share(self.is_apart),
            interval_coverage(own.center_spread, 2),
            _held(own.size_off[:, 0]),
            _held(own.size_off[:, 1]),
            _held(own.size_off[:, 2]),
            _held(own.axis_off),
            _share(own.is_reversed),
            _share(own.reversal),
        )


@dataclass(frozen=True)
class BoxIntervalMetrics(Metrics):
    """Shares of true boxes within the intervals that should hold 90 % of them; NaN without any.

    Attributes:
        boxes: Number of boxes of detected true objects.
        apart: Share of them that do not touch the true box; the other shares leave them out.
        center: Share of the centres over the ground.
        length: Share of the lengths.
        width: Share of the widths.
        height: Share of the heights.
        axis: Share of the headings modulo pi.
        reversed: Share of the boxes with front and rear exchanged.
        reversal: Mean reported probability of that.
    """

    boxes: Annotated[int, Metric("boxes")]
    apart: Annotated[float, Metric("of another", ".3f")]
    center: Annotated[float, Metric("centre", ".3f")]
    length: Annotated[float, Metric("length", ".3f")]
    width: Annotated[float, Metric("width", ".3f")]
    height: Annotated[float, Metric("height", ".3f")]
    axis: Annotated[float, Metric("axis", ".3f")]
    reversed: Annotated[float, Metric("reversed", ".3f")]
    reversal: Annotated[float, Metric("stated", ".3f")]


def box_intervals(
    objects: Vehicles | Tracks, rows: Int, true_boxes: Boxes3D, true_types: NDArray[np.str_]
) -> BoxIntervals:
    """Compare the boxes of some rows with the true boxes of the same objects.

    Args:
        objects: Detected vehicles or tracks in the LiDAR frame.
        rows: (N,) Rows of the objects; those without a box are left out.
        true_boxes: (N) True boxes in the LiDAR frame.
        true_types: (N,) Their classes.
    """
    has_box = np.isfinite(objects.boxes.yaw_rad[rows])
    rows, true, types = rows[has_box], true_boxes[has_box], true_types[has_box]
    found, deviations = objects.boxes[rows], objects.box_deviations[rows]
    turn_rad = found.yaw_rad - true.yaw_rad
    return BoxIntervals(
        types=types.astype(np.str_),
        range_m=np.hypot(true.bottom_m[:, 0], true.bottom_m[:, 1]),
        is_apart=np.diagonal(iou_bev(found, true)) == 0,
        center_spread=squared_mahalanobis(
            found.bottom_m[:, :2] - true.bottom_m[:, :2], objects.covariances[rows, :2, :2]
        ),
        size_off=np.abs(found.size_m - true.size_m) / deviations.size_m,
        axis_off=np.abs(wrap(turn_rad, np.pi)) / deviations.yaw_rad,
        is_reversed=np.abs(wrap(turn_rad)) > np.pi / 2,
        reversal=deviations.reversal,
    )


def _held(off: Float64) -> float:
    return _share((off <= _WITHIN)[np.isfinite(off)])


def _share(values: Bool | Float64) -> float:
    return float(values.mean()) if len(values) else float("nan")


def squared_mahalanobis(errors: Float64, covariances: Float64) -> Float64:
    """Return the (N,) squared Mahalanobis distances of (N, k) errors by (N, k, k) covariances; NaN without one.

    Of a true covariance and normal errors they are chi-squared with k degrees of freedom.
    """
    spread = np.full(len(errors), np.nan)
    known = np.isfinite(covariances).all(axis=(1, 2)) & np.isfinite(errors).all(axis=1)
    weighted = np.linalg.solve(covariances[known], errors[known][..., None])[..., 0]
    spread[known] = (errors[known] * weighted).sum(axis=1)
    return spread


def interval_coverage(squared_distances: Float64, dimensions: int) -> float:
    """Return the share of known squared Mahalanobis distances within the interval of the level; NaN without any."""
    known = squared_distances[np.isfinite(squared_distances)]
    return _share(known <= chi2.ppf(LEVEL, dimensions))


def groups(errors: Errors, rows: Mapping[str, Bool]) -> dict[str, Errors]:
    """Return the errors of each group that has any.

    Args:
        errors: (N) Errors.
        rows: (N,) Rows of each group, by its name.
    """
    return {name: errors[one] for name, one in rows.items() if one.any()}
