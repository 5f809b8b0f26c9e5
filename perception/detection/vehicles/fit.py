"""Boxes around vehicles of which one or two sides are seen.

 left ^          For each of some directions the points reach from `low` to `high`; the ends that
      |   . . .  face the sensor are the sides that are seen, and points should lie on them. What
 +----+    .  :  is unseen follows from the size of common cars. Which side is the long one, and
 |         .  :  how far the box goes on behind what hides it, is told by the box in the image:
 +-------- . .   the projection has to be as wide.
facing the sensor
"""

from dataclasses import dataclass

import numpy as np

from perception.types import Float32, Float64, Int


@dataclass(frozen=True)
class FitRules:
    """What is believed of vehicles, and of what is measured of them.

    Attributes:
        least_points: of a vehicle that is given a box.
        samples: points of each vehicle that are looked at.
        trimmed: share of them at either end that does not tell where the end is.
        directions: in a quarter of a turn, looked at first.
        finer: directions looked at around the best one.
        kept: directions of which sizes and places are tried.
        side_m: standard deviation of points on a side from it.
        inner_m: points farther inside are of roofs and seats, and all alike.
        side_weight: how many independent points all together are worth.
        lengths_m: that are tried.
        length_m: mean and standard deviation over common cars.
        width_m: likewise.
        height_m: of common cars.
        edge_px: deviation of a side of the box in the image.
        edge_share: the same, as a share of its width, to be added.
        hidden: cost of a box whose side towards the sensor is unseen.
        middle: cost of one that goes on to both sides of what is seen.
    """

    least_points: int = 3
    samples: int = 64
    trimmed: float = 0.02
    directions: int = 18
    finer: int = 7
    kept: int = 4
    side_m: float = 0.15
    inner_m: float = 0.4
    side_weight: float = 12.0
    lengths_m: tuple[float, ...] = (3.5, 4.0, 4.5)
    length_m: tuple[float, float] = (4.0, 0.5)
    width_m: tuple[float, float] = (1.65, 0.15)
    height_m: float = 1.5
    edge_px: float = 2.0
    edge_share: float = 0.07
    hidden: float = 4.0
    middle: float = 2.0


@dataclass(frozen=True)
class ImageSpans:
    """Where F vehicles are in the image, and how it is projected.

    Attributes:
        left_right_px: (F, 2) columns between which each is seen.
        image_P_velo: (3, 4).
        width_px: of the image.
        heights_m: (F,) z at which the vehicles are projected.
    """

    left_right_px: Float64
    image_P_velo: Float64
    width_px: int
    heights_m: Float64


@dataclass(frozen=True)
class Rectangles:
    """F rectangles on the ground.

    Attributes:
        centers_m: (F, 2).
        sizes_m: (F, 2) length and width.
        yaw_rad: (F,) of one of the two ends; which one is the front is not known.
    """

    centers_m: Float64
    sizes_m: Float64
    yaw_rad: Float64


@dataclass(frozen=True)
class _Reaches:
    """How far points reach along F x D directions and to the left of them; the sensor is at 0.

    Attributes:
        yaw_rad: (F, D).
        low_m: (F, D, 2).
        high_m: (F, D, 2).
        costs: (F, D) of points that lie on no side that is seen.
    """

    yaw_rad: Float32
    low_m: Float32
    high_m: Float32
    costs: Float32

    def best(self, count: int) -> "_Reaches":
        """Return the best directions of each vehicle."""
        if count >= self.costs.shape[1]:
            return self
        columns = np.argpartition(self.costs, count - 1, axis=1)[:, :count]
        return _Reaches(
            np.take_along_axis(self.yaw_rad, columns, axis=1),
            np.take_along_axis(self.low_m, columns[..., None], axis=1),
            np.take_along_axis(self.high_m, columns[..., None], axis=1),
            np.take_along_axis(self.costs, columns, axis=1),
        )


def fit_rectangles(
    xy_m: Float64, owners: Int, spans: ImageSpans, rules: FitRules = FitRules()
) -> Rectangles:
    """Fit a rectangle to the points of each of F vehicles.

    Args:
        xy_m: (K, 2) points around a sensor at the origin.
        owners: (K,) rising from 0 to F - 1; each owns at least one.
        spans: where they are in the image.
        rules: every choice.
    """
    # Single precision is a tenth of a millimetre at most, and takes half of the time.
    samples = _sampled(xy_m, owners, rules.samples).astype(np.float32)
    step_rad = np.pi / 2 / rules.directions
    coarse = np.tile(np.arange(rules.directions) * step_rad, (len(samples), 1)).astype(np.float32)
    first, first_rad = _best_rectangles(_reach(samples, coarse, rules), spans, rules)
    turns_rad = np.linspace(-step_rad, step_rad, rules.finer + 2)[1:-1].astype(np.float32)
    finer = _reach(samples, first_rad[:, None] + turns_rad, rules)
    return _best_rectangles(finer, spans, rules)[0] if len(samples) else first


def _sampled(xy_m: Float64, owners: Int, count: int) -> Float64:
    """Return (F, count, 2) points of each vehicle, evenly picked; some twice where there are fewer."""
    counts = np.bincount(owners)
    starts = np.cumsum(counts) - counts
    picked = (np.arange(count) + 0.5) / count * counts[:, None]
    return np.asarray(xy_m[starts[:, None] + picked.astype(np.int64)])


def _reach(samples: Float32, yaw_rad: Float32, rules: FitRules) -> _Reaches:
    """Measure samples (F, P, 2) along directions (F, D)."""
    cos, sin = np.cos(yaw_rad)[..., None], np.sin(yaw_rad)[..., None]
    x, y = samples[:, None, :, 0], samples[:, None, :, 1]
    turned = np.stack([cos * x + sin * y, cos * y - sin * x], axis=2)  # (F, D, 2, P)
    count = samples.shape[1]
    beyond = int(rules.trimmed * count)
    ordered: Float32 = np.partition(
        turned.astype(np.float32, copy=False), (beyond, count - 1 - beyond), axis=-1
    )
    low_m, high_m = ordered[..., beyond], ordered[..., count - 1 - beyond]
    # Only a side that faces the sensor is seen; one that the sensor is beside is not.
    side_m = np.where(low_m > 0, low_m, np.where(high_m < 0, high_m, np.inf))
    off_m = np.abs(turned - side_m[..., None]).min(axis=2)
    off = np.minimum(off_m, rules.inner_m) / rules.side_m
    costs = rules.side_weight * (off**2).mean(axis=-1)
    return _Reaches(yaw_rad, low_m, high_m, costs)


def _best_rectangles(
    reaches: _Reaches, spans: ImageSpans, rules: FitRules
) -> tuple[Rectangles, Float32]:
    """Try sizes and places; return the best and the direction (F,) along which it was measured."""
    reaches = reaches.best(rules.kept)
    sizes_m, size_costs = _sizes(reaches, rules)  # (F, T, O, 2)
    centers_m, place_costs = _places(reaches, sizes_m, rules)  # (F, T, O, 3, 2)
    span_costs = _span_costs(reaches.yaw_rad, sizes_m, centers_m, spans, rules)  # (F, T, O, 3, 3)
    costs = span_costs + (reaches.costs[..., None] + size_costs)[..., None, None]
    costs += place_costs[..., :, None, 0] + place_costs[..., None, :, 1]
    vehicles = np.arange(len(costs))
    best = costs.reshape(len(costs), -1).argmin(axis=1) if len(costs) else vehicles
    way, size, along, left = np.unravel_index(best, costs.shape[1:])
    direction = reaches.yaw_rad[vehicles, way]
    center = np.column_stack(
        [
            centers_m[vehicles, way, size, along, 0],
            centers_m[vehicles, way, size, left, 1],
        ]
    )
    chosen_m = sizes_m[vehicles, way, size].astype(np.float64)
    is_across = size >= len(rules.lengths_m)
    cos, sin = np.cos(direction), np.sin(direction)
    rectangles = Rectangles(
        np.column_stack(
            [cos * center[:, 0] - sin * center[:, 1], sin * center[:, 0] + cos * center[:, 1]]
        ),
        np.where(is_across[:, None], chosen_m[:, ::-1], chosen_m),
        direction.astype(np.float64) + np.where(is_across, np.pi / 2, 0.0),
    )
    return rectangles, direction


def _sizes(reaches: _Reaches, rules: FitRules) -> tuple[Float32, Float32]:
    """Return (F, T, O, 2) sizes along and left, first with the length along, and what they cost."""
    lengths_m, width_m = np.array(rules.lengths_m, np.float32), rules.width_m[0]
    along = np.column_stack([lengths_m, np.full_like(lengths_m, width_m)])
    seen_m = (reaches.high_m - reaches.low_m)[..., None, :]
    sizes_m = np.maximum(np.concatenate([along, along[:, ::-1]]), seen_m)
    is_across = np.arange(2 * len(lengths_m)) >= len(lengths_m)
    length_m = np.where(is_across, sizes_m[..., 1], sizes_m[..., 0])
    widths_m = np.where(is_across, sizes_m[..., 0], sizes_m[..., 1])
    off_length = (length_m - rules.length_m[0]) / rules.length_m[1]
    off_width = (widths_m - rules.width_m[0]) / rules.width_m[1]
    return sizes_m, off_length**2 + off_width**2


def _places(reaches: _Reaches, sizes_m: Float32, rules: FitRules) -> tuple[Float32, Float32]:
    """Return (F, T, O, 3, 2) centres that begin at the low end, lie evenly, end at the high end; and costs."""
    low_m, high_m = reaches.low_m[:, :, None], reaches.high_m[:, :, None]
    places_m: Float32 = np.stack(
        [
            low_m + sizes_m / 2,
            np.broadcast_to((low_m + high_m) / 2, sizes_m.shape),
            high_m - sizes_m / 2,
        ],
        axis=-2,
    )
    costs = np.empty((*reaches.low_m.shape[:2], 3, 2), np.float32)
    is_low_seen, is_high_seen = reaches.low_m > 0, reaches.high_m < 0
    costs[..., 0, :] = np.where(is_high_seen, rules.hidden, 0.0)
    costs[..., 1, :] = np.where(is_low_seen | is_high_seen, rules.middle, 0.0)
    costs[..., 2, :] = np.where(is_low_seen, rules.hidden, 0.0)
    places_m = places_m.astype(np.float32, copy=False)
    return places_m, np.broadcast_to(costs[:, :, None], places_m.shape)


def _span_costs(
    yaw_rad: Float32, sizes_m: Float32, centers_m: Float32, spans: ImageSpans, rules: FitRules
) -> Float32:
    """Return (F, T, O, 3, 3) how much the projection misses the sides of the box in the image."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    ways = np.stack([np.stack([cos, sin], -1), np.stack([-sin, cos], -1)], -2)  # (F, T, 2, xy)
    row, _, depth = spans.image_P_velo.astype(np.float32)
    heights_m = spans.heights_m.astype(np.float32)
    # Both are linear in place: a corner's are the centre's and half a size along each way.
    per_m = np.stack([ways @ row[:2], ways @ depth[:2]])[:, :, :, None]  # (2, F, T, 1, 2)
    start = np.stack([row[2] * heights_m + row[3], depth[2] * heights_m + depth[3]])
    parts = per_m[:, :, :, :, None] * centers_m  # (2, F, T, O, 3, 2)
    middle = parts[..., :, None, 0] + parts[..., None, :, 1] + start[:, :, None, None, None, None]
    halves = (per_m * sizes_m / 2)[..., None, None, :]
    sums, differences = halves.sum(axis=-1), halves[..., 0] - halves[..., 1]
    corners = (middle + sums, middle - sums, middle + differences, middle - differences)
    columns = [u / np.maximum(w, np.float32(0.1)) for u, w in corners]
    lowest, highest = np.minimum(*columns[:2]), np.maximum(*columns[:2])
    for column in columns[2:]:
        lowest, highest = np.minimum(lowest, column), np.maximum(highest, column)
    left, right = spans.left_right_px.astype(np.float32).T[:, :, None, None, None, None]
    deviation = rules.edge_px + rules.edge_share * (right - left)
    # Of what is beyond the image's sides, the box ends there.
    off_left = np.clip(lowest, 0, spans.width_px - 1) - left
    off_right = np.clip(highest, 0, spans.width_px - 1) - right
    return np.asarray((off_left**2 + off_right**2) / deviation**2)
