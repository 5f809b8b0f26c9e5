"""Size of a track: its past observations, and the size of a common vehicle that they suggest."""

from dataclasses import replace

import numpy as np

from perception.tracking.config import SizeEstimateConfig
from perception.tracking.track_table import TrackTable
from perception.types import Bool, Float64, Int


def likely_sizes_m(tracks: TrackTable, config: SizeEstimateConfig) -> Float64:
    """Return (T, 2) length and width: as observed if completely observed, else at least those of a common vehicle."""
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


def update_sizes(
    tracks: TrackTable, seen_m: Float64, is_complete: Bool, config: SizeEstimateConfig
) -> tuple[Float64, Float64, Int]:
    """Return the sizes, recent sizes and complete counts of each track after one more observation.

    A size grows towards the median of the last three observations. Once settled it shrinks only, slowly, while both
    ends are observed: an observation of a part does not shrink it.

    Args:
        tracks: T tracks.
        seen_m: (T, 2) observed length and width.
        is_complete: (T, 2) whether both ends are observed.
        config: Gains and limits.
    """
    limited_m = np.minimum(seen_m, config.max_size_m)
    recent_m = np.concatenate([limited_m[:, None], tracks.recent_sizes_m[:, :2]], axis=1)
    median_m = np.median(recent_m, axis=1)
    # A box along a wrong heading is too large, and the first headings are the least certain.
    shrinkage = np.maximum(config.shrink_gain, 1 / (1 + tracks.hits))[:, None]
    gain = np.where(
        median_m > tracks.sizes_m, config.growth_gain, np.where(is_complete, shrinkage, 0.0)
    )
    is_settled = tracks.hits >= config.settling_hits
    sizes_m = np.where(
        is_settled[:, None], tracks.sizes_m + gain * (median_m - tracks.sizes_m), median_m
    )
    return sizes_m, recent_m, tracks.complete_counts + (is_complete & is_settled[:, None])


def with_sides_swapped(tracks: TrackTable, rows: Bool) -> TrackTable:
    """Swap length and width of the tracks whose heading has turned by a quarter turn."""
    order = np.where(rows[:, None], [1, 0], [0, 1])
    return replace(
        tracks,
        sizes_m=np.take_along_axis(tracks.sizes_m, order, axis=1),
        recent_sizes_m=np.take_along_axis(tracks.recent_sizes_m, order[:, None], axis=2),
        complete_counts=np.asarray(
            np.take_along_axis(tracks.complete_counts, order, axis=1), np.int64
        ),
    )
