"""Uncertainty of reported boxes of moving objects: centre, size and heading.

A moving object has no class. What is hidden of it is as uncertain as the sizes of the class that is about as long, which may
be another; half of the error of a length is that of the centre.
"""

import numpy as np

from perception.tracking import motion_model
from perception.tracking.size_estimate import MIN_COMPLETE_HITS
from perception.tracking.track_table import TrackTable
from perception.tracking.vehicles.class_sizes import CLASS_SIZES, SizePriors
from perception.types import BoxDeviations, Float64

_LENGTH_M = 0.2  # standard deviation of a length of which both ends are seen
_HIDDEN_SHARE = 0.9  # of a class's deviations that observations leave of sizes not seen whole
_AXIS_RAD = 0.02  # standard deviation of the axis of an outline
_AXIS_SHARE = 0.6  # of the filter's deviation of the heading that is reported beside it
_REVERSAL = 0.01  # probability that the front is the rear

_CLASSES = np.array(["pedestrian", "cyclist", "car", "van", "truck", "tram"])
_LENGTHS_M = np.array([CLASS_SIZES[name].length.mean_m for name in _CLASSES.tolist()])


def reported_covariances(tracks: TrackTable, sizes_m: Float64) -> Float64:
    """Return (T, 4, 4) covariances of x, y and the velocity in the world, of tracks with (T, 3) sizes."""
    reported = motion_model.reported_covariances(tracks)
    along = np.stack([np.cos(tracks.yaw_rad), np.sin(tracks.yaw_rad)], axis=1)
    end_m = _size_deviations(tracks, sizes_m)[:, 0] / 2
    reported[:, :2, :2] += end_m[:, None, None] ** 2 * along[:, :, None] * along[:, None]
    return reported


def reported_deviations(tracks: TrackTable, sizes_m: Float64) -> BoxDeviations:
    """Return the standard deviations of the boxes of tracks with (T, 3) sizes."""
    filtered_rad = _AXIS_SHARE * np.sqrt(tracks.yaw_variance)
    return BoxDeviations(
        _size_deviations(tracks, sizes_m),
        np.hypot(_AXIS_RAD, filtered_rad),
        np.full(len(tracks), _REVERSAL),
    )


def _size_deviations(tracks: TrackTable, sizes_m: Float64) -> Float64:
    """Return (T, 3) standard deviations of the sizes."""
    one = np.ones(len(tracks))
    nearest = np.abs(sizes_m[:, :1] - _LENGTHS_M).argmin(axis=1)
    priors = SizePriors.of(_CLASSES[nearest])
    deviations_m = priors.deviations_m(sizes_m, _HIDDEN_SHARE * one, one)
    has_both_ends = tracks.complete_counts[:, 0] >= MIN_COMPLETE_HITS
    deviations_m[has_both_ends, 0] = _LENGTH_M
    return deviations_m
