"""Uncertainty of reported boxes of vehicles and people: centre, size, heading, and which end is the front.

A LiDAR sees the ends that face it. A hidden end is where the size of the class puts it, and whatever the number of scans, it
stays hidden: half of the error of the size is that of the centre. A person's middle is among the returns instead. And the
class may be another: a van is called a car, a cyclist a pedestrian, in a single scan more often than over a track.
"""

import numpy as np

from perception.tracking.motion_model import turned_variances
from perception.tracking.vehicles.class_sizes import SizePriors
from perception.types import Bool, BoxDeviations, Boxes3D, Float64, Int

_SIDE_NOISE_M, _SIDE_NOISE_PER_M = 0.06, 0.005  # of a seen side, and its growth with distance
# Of a side, and of a person's body, by one point; divided by the root of their number.
_SPARSE_NOISE_M, _SPARSE_BODY_NOISE_M = 1.6, 0.15
_SIZE_NOISE_PER_M = 0.002  # standard deviation of length and width, divided by the distance
_HIDDEN_SHARE = 0.7  # of a class's deviation of length and width that is left of a tracked object
_SINGLE_SCAN_MISTAKES = 4.0  # probability of another class in a single scan, in that of a track
_HEIGHT_NOISE_M = 0.03  # standard deviation of the height, at any distance
_HEIGHT_SHARE = 0.3  # of a class's deviation that is left of the height of an object with sides
_PERSON_HEIGHT_SHARE = 0.75  # the same of a person
_HEIGHT_RANGE_M = 50.0  # where returns tell a height no better than the class; by the square
_AXIS_NOISE_RAD = 0.03  # standard deviation of the axis of an outline of many points
# Of an outline of one point in a single scan, which takes the front for a side, and of a track's; divided by the same root.
_SPARSE_AXIS_NOISE_RAD, _TRACKED_AXIS_NOISE_RAD = 1.4, 0.3
_TRACK_SHARE = 0.25  # of the variance of the tracker's position, which holds the hidden ends, too
_VELOCITY_SHARE = 0.5  # the same of the velocity: most vehicles keep theirs
_TRAFFIC_REVERSAL = 0.1  # probability that a vehicle that has not moved faces against the traffic
_PERSON_REVERSAL = 0.4  # the same of people, whose outline hardly shows a heading
_ANY_AXIS_RAD = np.pi / np.sqrt(12)  # standard deviation of an axis of any direction
_CENTER_SHARE = 0.25  # of the size's deviation that is the centre's, with returns around the middle


def located_covariances(boxes: Boxes3D, point_counts: Int, sizes: SizePriors) -> Float64:
    """Return (M, 4, 4) covariances of x, y and the velocity of boxes of one scan in the LiDAR frame.

    Args:
        boxes: M boxes, rows of NaN without one.
        point_counts: (M,) numbers of their points.
        sizes: M sizes of their classes.
    """
    away_m = np.linalg.norm(boxes.bottom_m[:, :2], axis=1)
    noise = (
        _SIDE_NOISE_M**2
        + (_SIDE_NOISE_PER_M * away_m) ** 2
        + np.where(sizes.has_sides, _SPARSE_NOISE_M, _SPARSE_BODY_NOISE_M) ** 2
        / np.maximum(point_counts, 1)
    )
    covariances = np.full((len(boxes), 4, 4), np.nan)
    outlines_m = _outline_deviations(boxes, sizes, np.zeros(len(boxes), bool))
    hidden = _hidden_ends(boxes.yaw_rad, outlines_m, sizes)
    covariances[:, :2, :2] = hidden + noise[:, None, None] * np.eye(2)
    return covariances


def tracked_covariances(
    covariances: Float64, boxes: Boxes3D, sizes: SizePriors, is_confirmed: Bool
) -> Float64:
    """Return (T, 4, 4) covariances to report of x, y and the velocity of tracks.

    Args:
        covariances: (T, 4, 4) covariances of the tracker.
        boxes: T boxes in the same frame.
        sizes: T sizes of their classes.
        is_confirmed: (T,) Whether they are confirmed; the others have been seen in few scans.
    """
    shares = np.sqrt(np.repeat([_TRACK_SHARE, _VELOCITY_SHARE], 2))
    reported = covariances * np.outer(shares, shares)
    outlines_m = _outline_deviations(boxes, sizes, is_confirmed)
    reported[:, :2, :2] += _hidden_ends(boxes.yaw_rad, outlines_m, sizes)
    return np.asarray(reported)


def box_deviations(
    boxes: Boxes3D,
    point_counts: Int,
    sizes: SizePriors,
    is_confirmed: Bool | None = None,
) -> BoxDeviations:
    """Return the standard deviations of boxes in the LiDAR frame.

    Args:
        boxes: M boxes.
        point_counts: (M,) numbers of their points.
        sizes: M sizes of their classes.
        is_confirmed: (M,) Whether they are of confirmed tracks; None where none is.
    """
    has_sides = sizes.has_sides
    if is_confirmed is None:
        is_confirmed = np.zeros(len(boxes), bool)
    size_m = np.column_stack(
        [
            _outline_deviations(boxes, sizes, is_confirmed),
            _height_deviations(boxes, sizes, is_confirmed),
        ]
    )
    sparse_rad = np.where(is_confirmed, _TRACKED_AXIS_NOISE_RAD, _SPARSE_AXIS_NOISE_RAD)
    sparse_rad = sparse_rad / np.sqrt(np.maximum(point_counts, 1))
    axis_rad = np.minimum(np.hypot(_AXIS_NOISE_RAD, sparse_rad), _ANY_AXIS_RAD)
    return BoxDeviations(
        size_m,
        np.where(has_sides, axis_rad, _ANY_AXIS_RAD),
        np.where(has_sides, _TRAFFIC_REVERSAL, _PERSON_REVERSAL),
    )


def _outline_deviations(boxes: Boxes3D, sizes: SizePriors, is_confirmed: Bool) -> Float64:
    """Return (M, 2) standard deviations of lengths and widths."""
    share = np.where(is_confirmed, _HIDDEN_SHARE, 1.0)
    mistakes = np.where(is_confirmed, 1.0, _SINGLE_SCAN_MISTAKES)
    away_m = np.linalg.norm(boxes.bottom_m[:, :2], axis=1)
    outlines_m = sizes.deviations_m(boxes.size_m, share, mistakes)[:, :2]
    return np.asarray(np.hypot(outlines_m, _SIZE_NOISE_PER_M * away_m[:, None]))


def _height_deviations(boxes: Boxes3D, sizes: SizePriors, is_confirmed: Bool) -> Float64:
    """Return (M,) standard deviations of heights: of what the class tells, returns leave a share that grows with distance."""
    mistakes = np.where(is_confirmed, 1.0, _SINGLE_SCAN_MISTAKES)
    expected_m = np.column_stack([sizes.length_m[:, 0], sizes.width_m[:, 0], sizes.height_m[:, 0]])
    of_class_m = sizes.deviations_m(expected_m, np.ones(len(boxes)), mistakes)[:, 2]
    away_m = np.linalg.norm(boxes.bottom_m[:, :2], axis=1)
    near = np.where(sizes.has_sides, _HEIGHT_SHARE, _PERSON_HEIGHT_SHARE)
    far = np.minimum(away_m / _HEIGHT_RANGE_M, 1.0) ** 2
    return np.asarray(np.hypot(_HEIGHT_NOISE_M, of_class_m * np.hypot(near, far)))


def _hidden_ends(yaw_rad: Float64, outlines_m: Float64, sizes: SizePriors) -> Float64:
    """Return (M, 2, 2) covariances of centres by (M, 2) deviations of lengths and widths."""
    share = np.where(sizes.has_sides, 0.5, _CENTER_SHARE)
    return turned_variances((share[:, None] * outlines_m) ** 2, yaw_rad)
