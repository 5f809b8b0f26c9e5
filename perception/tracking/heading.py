"""Heading of a track: from its course once it is fast enough, before that from its shape."""

from dataclasses import replace

import numpy as np

from perception.geometry.footprints import Footprints
from perception.geometry.se3 import wrap
from perception.tracking.track_table import TrackTable
from perception.tracking.visible_sides import measure_extents
from perception.types import Bool, Float64

_TURN_RATE_RAD_S = 0.4  # standard deviation of turning; a car at a corner makes 0.5 rad/s
_MIN_SPEED_M_S = 0.7  # minimum speed at which the course is used
_FRONT_SPEED_M_S = 0.3  # minimum speed at which the course distinguishes front and rear
_MAX_DEVIATION_RAD = 0.5  # maximum standard deviation of a course that is used
_COURSE_DEVIATION_RAD = 0.06  # standard deviation of the heading from the course
_SHAPE_DEVIATION_RAD = 0.2  # of the heading from the axis of the outline's rectangle, of a car
_CAR_LENGTH_M = 5.2  # from which on this axis is more certain, by the square of the length
_SHAPE_LENGTH_M = 1.5  # minimum length of an outline whose axis is used
_FACE_WIDTH_M = (1.3, 2.2)  # range of widths of fronts and rears, from the smallest car to a van
_UNSETTLED_VARIANCE = 0.3  # variance (rad²) above which a heading is replaced rather than corrected
_REVERSE_SPEED_M_S = 3.0  # maximum speed of a vehicle that drives backwards
_VEHICLE_LENGTH_M = 2.4  # minimum length of an object that may drive backwards

UNKNOWN_VARIANCE = np.pi**2 / 3  # of a uniformly distributed angle


def yaws_of_shape(clusters: Footprints) -> Float64:
    """Return (F,) the direction, 0 to pi, of the longer side of the rectangle of least perimeter around each outline.

    The outline of two observed sides is a right triangle: its rectangles along a side and along the hypotenuse have
    the same area, not the same perimeter.
    """
    if len(clusters) == 0:
        return np.zeros(0)
    yaws_rad = np.arange(45) * np.pi / 2 / 45
    sizes_m = measure_extents(clusters, yaws_rad, np.zeros(2)).sizes_m
    best = np.argmin(sizes_m.sum(axis=2), axis=0)
    length_m, width_m = sizes_m[best, np.arange(len(clusters))].T
    return np.asarray(yaws_rad[best] + np.where(width_m > length_m, np.pi / 2, 0.0))


def first_yaws(clusters: Footprints, sensor_xy_m: Float64) -> Float64:
    """Return (F,) the likely heading of new clusters, except for its sign.

    It is that of the longer side; but a side that is as wide as a vehicle and faces the sensor is a front or a rear.
    """
    yaw_rad = yaws_of_shape(clusters)
    low_m, high_m = clusters.extents_m(yaw_rad)
    longer_m = (high_m - low_m)[:, 0]
    line_of_sight_m = clusters.centroids_m - sensor_xy_m
    off_rad = wrap(np.arctan2(line_of_sight_m[:, 1], line_of_sight_m[:, 0]) - yaw_rad, np.pi)
    is_width = (longer_m >= _FACE_WIDTH_M[0]) & (longer_m <= _FACE_WIDTH_M[1])
    is_face = is_width & (np.abs(off_rad) > np.pi / 4)
    return np.where(is_face, yaw_rad + np.pi / 2, yaw_rad)


def update_from_course(tracks: TrackTable, elapsed_s: float) -> TrackTable:
    """Predict every heading, and correct it by the course of its track."""
    variance = tracks.yaw_variance + (_TURN_RATE_RAD_S * elapsed_s) ** 2
    course_rad = np.arctan2(tracks.mean[:, 3], tracks.mean[:, 2])
    course_variance = _course_variance(tracks, course_rad)
    is_used = (tracks.speeds_m_s >= _MIN_SPEED_M_S) & (course_variance <= _MAX_DEVIATION_RAD**2)
    off_rad = wrap(course_rad - tracks.yaw_rad)
    is_backwards = (np.abs(off_rad) > np.pi / 2) & _may_reverse(tracks)
    off_rad = np.where(is_backwards, wrap(off_rad + np.pi), off_rad)
    is_new = (tracks.yaw_variance > _UNSETTLED_VARIANCE) | (np.abs(off_rad) > np.pi / 2)
    noise = course_variance + _COURSE_DEVIATION_RAD**2
    gain = np.where(is_new, 1.0, variance / (variance + noise)) * is_used
    left = np.where(is_new & is_used, noise, variance * (1 - gain))
    yaw_rad = np.where(is_new & ~is_used, _course_side(tracks, course_rad), tracks.yaw_rad)
    variance = np.minimum(left, UNKNOWN_VARIANCE)
    return replace(tracks, yaw_rad=wrap(yaw_rad + gain * off_rad), yaw_variance=variance)


def reported_yaws(tracks: TrackTable) -> Float64:
    """Return (T,) headings to report: one that is not settled yet points to the side of the course."""
    course_rad = np.arctan2(tracks.mean[:, 3], tracks.mean[:, 2])
    is_settled = tracks.yaw_variance <= _UNSETTLED_VARIANCE
    return np.where(is_settled, tracks.yaw_rad, _course_side(tracks, course_rad))


def _course_side(tracks: TrackTable, course_rad: Float64) -> Float64:
    """Return (T,) the one of both headings along the shape that is nearer to an uncertain course."""
    is_ahead = np.abs(wrap(course_rad - tracks.yaw_rad)) <= np.pi / 2
    is_slow = tracks.speeds_m_s < _FRONT_SPEED_M_S
    return np.where(is_ahead | is_slow, tracks.yaw_rad, tracks.yaw_rad + np.pi)


def _course_variance(tracks: TrackTable, course_rad: Float64) -> Float64:
    """Return (T,) the variance of the course, to first order."""
    across = np.stack([-np.sin(course_rad), np.cos(course_rad)], axis=-1)
    spread = np.einsum("ti,tij,tj->t", across, tracks.covariance[:, 2:, 2:], across)
    return np.asarray(spread / np.maximum(tracks.speeds_m_s, 1e-3) ** 2)


def _may_reverse(tracks: TrackTable) -> Bool:
    is_vehicle = tracks.sizes_m[:, 0] >= _VEHICLE_LENGTH_M
    is_slow = tracks.speeds_m_s < _REVERSE_SPEED_M_S
    return np.asarray(is_vehicle & is_slow & (tracks.yaw_variance <= _UNSETTLED_VARIANCE))


def update_from_shape(tracks: TrackTable, clusters: Footprints) -> TrackTable:
    """Correct the heading of each of T tracks by the axis of the cluster that continues it.

    A rectangle does not show its front: its four headings are equivalent, and none turns a track by more than an
    eighth of a turn.
    """
    shape_rad = yaws_of_shape(clusters)
    low_m, high_m = clusters.extents_m(shape_rad)
    length_m = (high_m - low_m)[:, 0]
    has_shape = length_m >= _SHAPE_LENGTH_M
    # The rounded and hidden corners of a rectangle turn its axis the less, the longer and slimmer it is.
    shape_variance = (
        _SHAPE_DEVIATION_RAD * (_CAR_LENGTH_M / np.maximum(length_m, _CAR_LENGTH_M)) ** 2
    ) ** 2
    off_rad = wrap(shape_rad - tracks.yaw_rad, np.pi / 2)
    # A heading without a course is that of the last rectangle, and as good as this one.
    known = np.minimum(tracks.yaw_variance, shape_variance)
    gain = has_shape * (known / (known + shape_variance))
    yaw_rad = tracks.yaw_rad + gain * off_rad
    # Which of the four it is stays unknown until the object moves.
    is_settled = tracks.yaw_variance <= _UNSETTLED_VARIANCE
    variance = np.where(is_settled, tracks.yaw_variance * (1 - gain), tracks.yaw_variance)
    return replace(tracks, yaw_rad=wrap(yaw_rad), yaw_variance=variance)
