"""L-shape fit: boxes around vehicles of which one or two sides are observed.

 left ^          Along each of some directions the points extend from `low` to `high`; the ends that
      |   . . .  face the sensor are the observed sides, and points should lie on them. The hidden
 +----+    .  :  sides follow from the size of common cars. The 2D box determines which side is the
 |         .  :  long one, and how far the box extends behind an occlusion: the projection has to be
 +-------- . .   as wide.
facing the sensor
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from perception.tracking.vehicles.class_sizes import SizePriors
from perception.types import ArrayTable, Float32, Float64

_TRIM_SHARE = 0.02  # share of the points that is left out at either end
_DIRECTIONS = 18  # number of directions within a quarter turn
_FINE_DIRECTIONS = 7  # number of directions around the best one
_KEPT_DIRECTIONS = 4  # number of directions for which sizes and positions are tried
_SIDE_DEVIATION_M = 0.15  # standard deviation of points from the side they lie on
_MAX_SIDE_DISTANCE_M = 0.4  # beyond which a point costs no more, as on roofs and seats
_SIDE_WEIGHT = 12.0  # number of independent observations that all points together are worth
_LENGTH_STEPS = (-1.0, 0.0, 1.0)  # lengths that are tried, in deviations from the mean of the class
_EDGE_DEVIATION_PX = 2.0  # standard deviation of the sides of the 2D box
_EDGE_DEVIATION_SHARE = 0.07  # increase of the same, as a share of the box's width
_HIDDEN_SIDE_COST = 4.0  # cost of a box whose side towards the sensor is not observed
_CENTERED_COST = 2.0  # cost of a box that extends beyond both ends of the points


@dataclass(frozen=True)
class ImageSpans:
    """Columns of F vehicles in the image, and their projection.

    Attributes:
        left_right_px: (F, 2) left and right column of each vehicle.
        image_P_velo: (3, 4) projection from the LiDAR frame to pixels.
        width_px: Width of the image.
        heights_m: (F,) z at which the vehicles are projected.
    """

    left_right_px: Float64
    image_P_velo: Float64
    width_px: int
    heights_m: Float64


@dataclass(frozen=True)
class Rectangles(ArrayTable):
    """F rectangles on the ground.

    Attributes:
        centers_m: (F, 2) centres.
        sizes_m: (F, 2) lengths and widths.
        yaw_rad: (F,) directions of one of the two ends; which one is the front is not known.
    """

    centers_m: Annotated[Float64, 2]
    sizes_m: Annotated[Float64, 2]
    yaw_rad: Float64


@dataclass(frozen=True)
class _Extents:
    """Extents of points along F x D directions and to the left of them; the sensor is at 0.

    Attributes:
        yaw_rad: (F, D) directions.
        low_m: (F, D, 2) minimum coordinates.
        high_m: (F, D, 2) maximum coordinates.
        costs: (F, D) costs of points that lie on no observed side.
    """

    yaw_rad: Float32
    low_m: Float32
    high_m: Float32
    costs: Float32

    def best(self, count: int) -> "_Extents":
        """Return the best directions of each vehicle."""
        if count >= self.costs.shape[1]:
            return self
        columns = np.argpartition(self.costs, count - 1, axis=1)[:, :count]
        chosen = np.arange(len(columns))[:, None], columns
        return _Extents(
            self.yaw_rad[chosen], self.low_m[chosen], self.high_m[chosen], self.costs[chosen]
        )


def fit_rectangles(samples_m: Float64, sizes: SizePriors, spans: ImageSpans) -> Rectangles:
    """Fit a rectangle to the points of each of F vehicles.

    Args:
        samples_m: (F, P, 2) points of each vehicle around a sensor at the origin.
        sizes: (F) sizes of the vehicles' classes.
        spans: Columns of the vehicles in the image.
    """
    # Single precision is accurate to a tenth of a millimetre, and takes half of the time.
    samples = samples_m.astype(np.float32)
    step_rad = np.pi / 2 / _DIRECTIONS
    coarse = np.tile(np.arange(_DIRECTIONS) * step_rad, (len(samples), 1)).astype(np.float32)
    first, first_rad = _best_rectangles(_measure_extents(samples, coarse), sizes, spans)
    turns_rad = np.linspace(-step_rad, step_rad, _FINE_DIRECTIONS + 2)[1:-1].astype(np.float32)
    finer = _measure_extents(samples, first_rad[:, None] + turns_rad)
    return _best_rectangles(finer, sizes, spans)[0] if len(samples) else first


def _measure_extents(samples: Float32, yaw_rad: Float32) -> _Extents:
    """Return the extents of samples (F, P, 2) along directions (F, D)."""
    vehicles, count = samples.shape[:2]
    axes = _axes(yaw_rad).reshape(vehicles, 2 * yaw_rad.shape[1], 2)
    turned = (axes @ samples.swapaxes(1, 2)).reshape(*yaw_rad.shape, 2, count)
    beyond = int(_TRIM_SHARE * count)
    # Sorting this few takes a tenth of the time of np.partition.
    ordered = np.sort(turned, axis=-1)
    low_m, high_m = ordered[..., beyond], ordered[..., count - 1 - beyond]
    # Only a side that faces the sensor is observed, not one that the sensor is beside.
    side_m = np.where(low_m > 0, low_m, np.where(high_m < 0, high_m, np.inf))
    off_m = np.abs(turned - side_m[..., None])
    off_m = np.minimum(off_m[:, :, 0], off_m[:, :, 1])
    off = np.minimum(off_m, _MAX_SIDE_DISTANCE_M) / _SIDE_DEVIATION_M
    costs = _SIDE_WEIGHT * (off**2).mean(axis=-1)
    return _Extents(yaw_rad, low_m, high_m, costs)


def _axes(yaw_rad: Float32) -> Float32:
    """Return (F, D, 2, 2) x and y of the unit vectors along (F, D) directions and to the left of them."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.stack([cos, sin, -sin, cos], axis=-1).reshape(*yaw_rad.shape, 2, 2)


def _best_rectangles(
    extents: _Extents, sizes: SizePriors, spans: ImageSpans
) -> tuple[Rectangles, Float32]:
    """Return the best of all sizes and positions, and the direction (F,) along which it was measured."""
    extents = extents.best(_KEPT_DIRECTIONS)
    # Short axes come first, vehicles and directions last, which makes for long inner loops.
    sizes_m, size_costs = _sizes(extents, sizes)  # (2, O, F, T), (O, F, T)
    centers_m, position_costs = _positions(extents, sizes_m)  # (3, 2, O, F, T), (3, 2, F, T)
    costs = _span_costs(extents.yaw_rad, sizes_m, centers_m, spans)  # (3, 3, O, F, T)
    costs += extents.costs + size_costs
    costs += (position_costs[:, None, 0] + position_costs[None, :, 1])[:, :, None]
    costs = costs.transpose(3, 4, 2, 0, 1)
    vehicles = np.arange(len(costs))
    best = costs.reshape(len(costs), -1).argmin(axis=1) if len(costs) else vehicles
    direction_row, size, along, left = np.unravel_index(best, costs.shape[1:])
    direction = extents.yaw_rad[vehicles, direction_row]
    center = np.column_stack(
        [
            centers_m[along, 0, size, vehicles, direction_row],
            centers_m[left, 1, size, vehicles, direction_row],
        ]
    )
    chosen_m = sizes_m[:, size, vehicles, direction_row].T.astype(np.float64)
    is_across = size >= len(_LENGTH_STEPS)
    cos, sin = np.cos(direction), np.sin(direction)
    rectangles = Rectangles(
        np.column_stack(
            [cos * center[:, 0] - sin * center[:, 1], sin * center[:, 0] + cos * center[:, 1]]
        ),
        np.where(is_across[:, None], chosen_m[:, ::-1], chosen_m),
        direction.astype(np.float64) + np.where(is_across, np.pi / 2, 0.0),
    )
    return rectangles, direction


def _sizes(extents: _Extents, sizes: SizePriors) -> tuple[Float32, Float32]:
    """Return (2, O, F, T) sizes along and left, first with the length along, and their costs."""
    mean_m, deviation_m = sizes.length_m.T.astype(np.float32)
    steps = np.array(_LENGTH_STEPS, np.float32)
    lengths_m = mean_m + steps[:, None] * deviation_m  # (S, F)
    widths_m = np.broadcast_to(sizes.width_m[:, 0].astype(np.float32), lengths_m.shape)
    either_m = np.stack(
        [np.concatenate([lengths_m, widths_m]), np.concatenate([widths_m, lengths_m])]
    )
    seen_m = (extents.high_m - extents.low_m).transpose(2, 0, 1).copy()
    sizes_m = np.maximum(either_m[..., None], seen_m[:, None])
    along, across = sizes_m[:, : len(steps)], sizes_m[::-1, len(steps) :]
    length_m, width_m = np.concatenate([along, across], axis=1)
    costs = np.zeros_like(length_m)
    for size_m, prior_m in ((length_m, sizes.length_m), (width_m, sizes.width_m)):
        mean_m, deviation_m = prior_m.T.astype(np.float32)[:, :, None]
        costs += ((size_m - mean_m) / deviation_m) ** 2
    return sizes_m, costs


def _positions(extents: _Extents, sizes_m: Float32) -> tuple[Float32, Float32]:
    """Return (3, 2, O, F, T) centres of boxes at the low end, centred, and at the high end; and their costs."""
    low_m, high_m = (end_m.transpose(2, 0, 1).copy() for end_m in (extents.low_m, extents.high_m))
    half_m = sizes_m / 2
    positions_m = np.empty((3, *sizes_m.shape), np.float32)
    positions_m[0] = low_m[:, None] + half_m
    positions_m[1] = ((low_m + high_m) / 2)[:, None]
    positions_m[2] = high_m[:, None] - half_m
    costs = np.empty((3, *low_m.shape), np.float32)
    is_low_seen, is_high_seen = low_m > 0, high_m < 0
    costs[0] = np.where(is_high_seen, _HIDDEN_SIDE_COST, 0.0)
    costs[1] = np.where(is_low_seen | is_high_seen, _CENTERED_COST, 0.0)
    costs[2] = np.where(is_low_seen, _HIDDEN_SIDE_COST, 0.0)
    return positions_m, costs


def _span_costs(
    yaw_rad: Float32, sizes_m: Float32, centers_m: Float32, spans: ImageSpans
) -> Float32:
    """Return (3, 3, O, F, T) the cost of the difference between the projection and the 2D box."""
    rows = spans.image_P_velo[[0, 2]].astype(np.float32)
    heights_m = spans.heights_m.astype(np.float32)
    # Column times depth, and depth, are linear in position: a corner's are the centre's plus half a size
    # along each axis.
    per_m = np.einsum("ui,ftwi->uwft", rows[:, :2], _axes(yaw_rad), order="C")
    start = (rows[:, 2:3] * heights_m + rows[:, 3:])[:, None, None, None, :, None]
    along, left = np.moveaxis(per_m[:, None, :, None] * centers_m, 2, 0)  # (2, 3, O, F, T)
    middle = along[:, :, None] + left[:, None] + start  # (2, 3, 3, O, F, T)
    one, other = np.moveaxis(per_m[:, :, None] * (sizes_m / 2), 1, 0)[:, :, None, None]
    sums, differences = one + other, one - other
    u, w = np.stack([middle + sums, middle - sums, middle + differences, middle - differences], 1)
    columns = u / np.maximum(w, np.float32(0.1))  # (4, 3, 3, O, F, T)
    left_px, right_px = spans.left_right_px.astype(np.float32).T[:, :, None]
    deviation_px = _EDGE_DEVIATION_PX + _EDGE_DEVIATION_SHARE * (right_px - left_px)
    # A 2D box ends at the image's sides.
    off_left = np.clip(columns.min(axis=0), 0, spans.width_px - 1) - left_px
    off_right = np.clip(columns.max(axis=0), 0, spans.width_px - 1) - right_px
    return np.asarray((off_left**2 + off_right**2) / deviation_px**2)
