"""Fit of people, on foot or on a cycle: their returns lie around the middle, not on flat sides.

The middle is a little behind the median of the returns, as the far half of a body is hidden. Returns spread along the
heading and across it as length and width of the class do: much for a cycle, which is thin, little for a pedestrian. Most
people move along the road, as the vehicle drives.
"""

import numpy as np

from perception.detection.vehicles.config import BodyFitConfig
from perception.detection.vehicles.l_shape_fit import Rectangles
from perception.tracking.vehicles.class_sizes import SizePriors
from perception.types import Float64


def fit_bodies(samples_m: Float64, sizes: SizePriors, config: BodyFitConfig) -> Rectangles:
    """Return the rectangle around each of F people, of the size of their class.

    Args:
        samples_m: (F, P, 2) points of each around a sensor at the origin.
        sizes: (F) sizes of their classes.
        config: Position and directions.
    """
    medians_m = np.median(samples_m, axis=1)
    away_m = np.maximum(np.hypot(*medians_m.T), 1e-6)[:, None]
    centers_m = medians_m * (1 + config.hidden_depth_m / away_m)
    sizes_m = np.column_stack([sizes.length_m[:, 0], sizes.width_m[:, 0]])
    yaw_rad = np.arange(config.directions) * np.pi / config.directions
    offsets_m = samples_m - medians_m[:, None]
    costs = np.zeros((len(samples_m), config.directions))
    for turn_rad, size_m in zip((0, np.pi / 2), sizes_m.T, strict=True):
        axes = np.stack([np.cos(yaw_rad + turn_rad), np.sin(yaw_rad + turn_rad)])
        off = (offsets_m @ axes) / (config.spread_share * size_m[:, None, None])  # (F, P, D)
        costs += config.weight * np.minimum(off**2, config.max_deviations**2).mean(axis=1)
    costs += (np.sin(yaw_rad) / np.sin(config.road_deviation_rad)) ** 2
    return Rectangles(
        centers_m,
        sizes_m,
        yaw_rad[costs.argmin(axis=1)],
    )
