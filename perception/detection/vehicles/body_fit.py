"""Fit of people, on foot or on a cycle: their returns lie around the middle, not on flat sides.

The middle is a little behind the median of the returns, as the far half of a body is hidden. Returns spread along the
heading and across it as length and width of the class do: much for a cycle, which is thin, little for a pedestrian. Most
people move along the road, as the vehicle drives.
"""

import numpy as np

from perception.detection.vehicles.l_shape_fit import Rectangles
from perception.tracking.vehicles.class_sizes import SizePriors
from perception.types import Float64

_HIDDEN_DEPTH_M = 0.1  # distance of the middle behind the median of the returns
_DIRECTIONS = 18  # number of directions within half a turn
_SPREAD_SHARE = 0.25  # standard deviation of returns along length and width, as a share of these
_MAX_DEVIATIONS = 3.0  # number of standard deviations beyond which a point costs no more
_WEIGHT = 6.0  # number of independent observations that all returns together are worth
_ROAD_DEVIATION_RAD = 0.6  # standard deviation of headings from the vehicle's


def fit_bodies(samples_m: Float64, sizes: SizePriors) -> Rectangles:
    """Return the rectangle around each of F people, of the size of their class.

    Args:
        samples_m: (F, P, 2) points of each around a sensor at the origin.
        sizes: (F) sizes of their classes.
    """
    medians_m = np.median(samples_m, axis=1)
    away_m = np.maximum(np.hypot(*medians_m.T), 1e-6)[:, None]
    centers_m = medians_m * (1 + _HIDDEN_DEPTH_M / away_m)
    sizes_m = np.column_stack([sizes.length_m[:, 0], sizes.width_m[:, 0]])
    yaw_rad = np.arange(_DIRECTIONS) * np.pi / _DIRECTIONS
    offsets_m = samples_m - medians_m[:, None]
    costs = np.zeros((len(samples_m), _DIRECTIONS))
    for turn_rad, size_m in zip((0, np.pi / 2), sizes_m.T, strict=True):
        axes = np.stack([np.cos(yaw_rad + turn_rad), np.sin(yaw_rad + turn_rad)])
        off = (offsets_m @ axes) / (_SPREAD_SHARE * size_m[:, None, None])  # (F, P, D)
        costs += _WEIGHT * np.minimum(off**2, _MAX_DEVIATIONS**2).mean(axis=1)
    costs += (np.sin(yaw_rad) / np.sin(_ROAD_DEVIATION_RAD)) ** 2
    return Rectangles(centers_m, sizes_m, yaw_rad[costs.argmin(axis=1)])
