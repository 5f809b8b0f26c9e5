"""How long, wide and high a tracked thing is: what was seen of it so far, and what that suggests."""

from dataclasses import replace

import numpy as np

from perception.tracking.config import SizeEstimateConfig
from perception.tracking.track_table import TrackTable
from perception.types import Bool, Float64, Int


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
    limited_m = np.minimum(seen_m, config.max_size_m)
    recent_m = np.concatenate([limited_m[:, None], tracks.recent_sizes_m[:, :2]], axis=1)
    usual_m = np.median(recent_m, axis=1)
    # A box along a wrong heading is too large, and the first few headings are the worst.
    shrinkage = np.maximum(config.shrink_gain, 1 / (1 + tracks.hits))[:, None]
    gain = np.where(
        usual_m > tracks.sizes_m, config.growth_gain, np.where(is_complete, shrinkage, 0.0)
    )
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
