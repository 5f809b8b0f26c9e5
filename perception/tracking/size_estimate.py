"""Size of a track: its past observations, and the size of a common vehicle that they suggest."""

from dataclasses import replace

import numpy as np

from perception.tracking.track_table import TrackTable
from perception.types import Bool, Float64, Int

_SETTLING_HITS = 4  # before which the size is the observed one, as the heading is not known yet
MIN_COMPLETE_HITS = 5  # number of complete observations after which a length or width is known
_VEHICLE_LENGTH_M, _VEHICLE_WIDTH_M = 2.4, 1.3  # minimum of a vehicle
_LENGTH_PER_WIDTH = 2.4  # of vehicles; 2.4 for the mean car, 2.7 for the mean van of KITTI
_PRIOR_LENGTH_M = (3.6, 5.2)  # range of vehicle lengths, from a small car to a van
_PRIOR_WIDTH_M = 1.7  # width of a vehicle of which only the side was observed
_MIN_SIZE_M = (0.8, 0.6)  # minimum length and width of a moving object
_GROWTH_GAIN, _SHRINK_GAIN = 0.25, 0.03  # of a correction to a larger and to a smaller size
_MAX_SIZE_M = (20.0, 3.2)  # length and width of a city bus; larger clusters are several objects


def likely_sizes_m(tracks: TrackTable) -> Float64:
    """Return (T, 2) length and width: as observed if completely observed, else at least those of a common vehicle."""
    length_m, width_m = np.maximum(tracks.sizes_m, _MIN_SIZE_M).T
    is_known = tracks.complete_counts >= MIN_COMPLETE_HITS
    common_m = np.clip(_LENGTH_PER_WIDTH * width_m, *_PRIOR_LENGTH_M)
    is_wide = (width_m >= _VEHICLE_WIDTH_M) & ~is_known[:, 0]
    is_long = (length_m >= _VEHICLE_LENGTH_M) & ~is_known[:, 1]
    return np.column_stack(
        [
            np.where(is_wide, np.maximum(length_m, common_m), length_m),
            np.where(is_long, np.maximum(width_m, _PRIOR_WIDTH_M), width_m),
        ]
    )


def update_sizes(
    tracks: TrackTable, seen_m: Float64, is_complete: Bool
) -> tuple[Float64, Float64, Int]:
    """Return the sizes, recent sizes and complete counts of each track after one more observation.

    A size grows towards the median of the last three observations. Once settled it shrinks only, slowly, while both
    ends are observed: an observation of a part does not shrink it.

    Args:
        tracks: T tracks.
        seen_m: (T, 2) observed length and width.
        is_complete: (T, 2) whether both ends are observed.
    """
    limited_m = np.minimum(seen_m, _MAX_SIZE_M)
    recent_m = np.concatenate([limited_m[:, None], tracks.recent_sizes_m[:, :2]], axis=1)
    median_m = np.median(recent_m, axis=1)
    # A box along a wrong heading is too large, and the first headings are the least certain.
    shrinkage = np.maximum(_SHRINK_GAIN, 1 / (1 + tracks.hits))[:, None]
    gain = np.where(median_m > tracks.sizes_m, _GROWTH_GAIN, np.where(is_complete, shrinkage, 0.0))
    is_settled = tracks.hits >= _SETTLING_HITS
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
