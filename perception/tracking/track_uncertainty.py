"""Uncertainty of reported boxes of moving objects: centre, size and heading.

A moving object has no class. What is hidden of it is as uncertain as the sizes of the class that is about as long, which may
be another; half of the error of a length is that of the centre.
"""

import numpy as np

from perception.tracking import motion_model
from perception.tracking.config import BoxTrackerConfig
from perception.tracking.track_table import TrackTable
from perception.tracking.vehicles.class_sizes import CLASS_SIZES, SizePriors
from perception.types import BoxDeviations, Float64

_CLASSES = np.array(["pedestrian", "cyclist", "car", "van", "truck", "tram"])
_LENGTHS_M = np.array([CLASS_SIZES[name].length.mean_m for name in _CLASSES.tolist()])


def reported_covariances(tracks: TrackTable, sizes_m: Float64, config: BoxTrackerConfig) -> Float64:
    """Return (T, 4, 4) covariances of x, y and the velocity in the world, of tracks with (T, 3) sizes."""
    reported = motion_model.reported_covariances(tracks.states, config.motion)
    along = np.stack([np.cos(tracks.yaw_rad), np.sin(tracks.yaw_rad)], axis=1)
    end_m = _size_deviations(tracks, sizes_m, config)[:, 0] / 2
    reported[:, :2, :2] += end_m[:, None, None] ** 2 * along[:, :, None] * along[:, None]
    return reported


def reported_deviations(
    tracks: TrackTable, sizes_m: Float64, config: BoxTrackerConfig
) -> BoxDeviations:
    """Return the standard deviations of the boxes of tracks with (T, 3) sizes."""
    uncertainty = config.uncertainty
    filtered_rad = uncertainty.axis_share * np.sqrt(tracks.yaw_variance)
    return BoxDeviations(
        _size_deviations(tracks, sizes_m, config),
        np.hypot(uncertainty.axis_rad, filtered_rad),
        np.full(len(tracks), uncertainty.reversal),
    )


def _size_deviations(tracks: TrackTable, sizes_m: Float64, config: BoxTrackerConfig) -> Float64:
    """Return (T, 3) standard deviations of the sizes."""
    uncertainty, one = config.uncertainty, np.ones(len(tracks))
    nearest = np.abs(sizes_m[:, :1] - _LENGTHS_M).argmin(axis=1)
    priors = SizePriors.of(_CLASSES[nearest])
    deviations_m = priors.deviations_m(sizes_m, uncertainty.hidden_share * one, one)
    has_both_ends = tracks.complete_counts[:, 0] >= config.size.min_complete_hits
    deviations_m[has_both_ends, 0] = uncertainty.length_m
    return deviations_m
