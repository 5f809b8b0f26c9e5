"""How long, wide and high a tracked thing is: what was seen of it so far, and what that suggests."""

from dataclasses import dataclass, replace

import numpy as np

from perception.tracking.track_table import TrackTable
from perception.types import Bool, Float64, Int


@dataclass(frozen=True)
class SizeEstimateConfig:
    """What is believed of a thing's size.

    Attributes:
        settling_hits: before so many, the size is what was seen last, since the heading is not known yet.
        min_complete_hits: seen from end to end so often, a length or width is known.
        complete_angle_rad: a face that is slanted more to the line of sight does not show its far end.
        vehicle_width_m: what is so wide has the length of a vehicle; narrower are two-wheelers.
        vehicle_length_m: what is so long has the width of a vehicle; shorter are two-wheelers.
        length_per_width: of vehicles; 2.4 for the mean car and 2.7 for the mean van of KITTI's labels.
        prior_length_m: range of the lengths that a width suggests, a small car to a van.
        prior_width_m: of a vehicle whose side alone was seen; 1.6 to 1.9 m in KITTI's labels.
        min_length_m: of anything that moves on its own.
        min_width_m: of anything that moves on its own.
        growth: share of the way to a larger size that one sight makes.
        shrinkage: share of the way to a smaller one.
        largest_m: length and width of a city bus: what is larger is several things.
    """

    settling_hits: int = 4
    min_complete_hits: int = 5
    complete_angle_rad: float = float(np.radians(10.0))
    vehicle_width_m: float = 1.3
    vehicle_length_m: float = 2.4
    length_per_width: float = 2.4
    prior_length_m: tuple[float, float] = (3.6, 5.2)
    prior_width_m: float = 1.7
    min_length_m: float = 0.8
    min_width_m: float = 0.6
    growth: float = 0.25
    shrinkage: float = 0.03
    largest_m: tuple[float, float] = (12.0, 3.0)


def likely_sizes_m(tracks: TrackTable, config: SizeEstimateConfig) -> Float64:
    """Return (T, 2) length and width: as seen where seen whole, else at least what is common."""
    least = np.array([config.min_length_m, config.min_width_m])
    length_m, width_m = np.maximum(tracks.sizes_m, least).T
    is_known = tracks.complete_counts >= config.min_complete_hits
    common_m = np.clip(config.length_per_width * width_m, *config.prior_length_m)
    is_wide = (width_m >= config.vehicle_width_m) & ~is_known[:, 0]
    is_long = (length_m >= config.vehicle_length_m) & ~is_known[:, 1]
    return np.column_stack(
        [
            np.where(is_wide, np.maximum(length_m, common_m), length_m),
            np.where(is_long, np.maximum(width_m, config.prior_width_m), width_m),
        ]
    )


def remember(
    tracks: TrackTable, seen_m: Float64, is_complete: Bool, config: SizeEstimateConfig
) -> tuple[Float64, Float64, Int]:
    """Return the new sizes, recent sizes and complete counts after each track was seen once more.

    A size grows towards what two of the last three sights reached. Once settled it goes back only from
    what noise added to it, while the thing is seen from end to end: part of a thing does not shrink it.

    Args:
        tracks: T.
        seen_m: (T, 2) length and width of what was seen now.
        is_complete: (T, 2) whether from end to end.
        config: what is believed.
    """
    limited_m = np.minimum(seen_m, config.largest_m)
    recent_m = np.concatenate([limited_m[:, None], tracks.recent_sizes_m[:, :2]], axis=1)
    usual_m = np.median(recent_m, axis=1)
    # A box along a wrong heading is too large, and the first few headings are the worst.
    shrinkage = np.maximum(config.shrinkage, 1 / (1 + tracks.hits))[:, None]
    gain = np.where(usual_m > tracks.sizes_m, config.growth, np.where(is_complete, shrinkage, 0.0))
    is_settled = tracks.hits >= config.settling_hits
    sizes_m = np.where(
        is_settled[:, None], tracks.sizes_m + gain * (usual_m - tracks.sizes_m), usual_m
    )
    return sizes_m, recent_m, tracks.complete_counts + (is_complete & is_settled[:, None])


def with_sides_swapped(tracks: TrackTable, rows: Bool) -> TrackTable:
    """Take length for width and width for length where a heading turned out to be a quarter turn off."""
    order = np.where(rows[:, None], [1, 0], [0, 1])
    return replace(
        tracks,
        sizes_m=np.take_along_axis(tracks.sizes_m, order, axis=1),
        recent_sizes_m=np.take_along_axis(tracks.recent_sizes_m, order[:, None], axis=2),
        complete_counts=np.asarray(
            np.take_along_axis(tracks.complete_counts, order, axis=1), np.int64
        ),
    )
