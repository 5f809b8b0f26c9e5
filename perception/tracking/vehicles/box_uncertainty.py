"""Uncertainty of reported boxes of vehicles and people: centre, size, heading, and which end is the front.

A LiDAR sees the ends that face it. A hidden end is where the size of the class puts it, and whatever the number of scans, it
stays hidden: half of the error of the size is that of the centre. A person's middle is among the returns instead. And the
class may be another: a van is called a car, a cyclist a pedestrian, in a single scan more often than over a track.
"""

import numpy as np

from perception.tracking.vehicles.class_sizes import SizePriors
from perception.tracking.vehicles.config import BoxUncertaintyConfig
from perception.types import Bool, BoxDeviations, Boxes3D, Float64, Int

_ANY_AXIS_RAD = np.pi / np.sqrt(12)  # standard deviation of an axis of any direction
_CENTER_SHARE = (
    0.25  # of the size's deviation that is a centre's where returns lie around the middle
)


def located_covariances(
    boxes: Boxes3D, point_counts: Int, sizes: SizePriors, config: BoxUncertaintyConfig
) -> Float64:
    """Return (M, 4, 4) covariances of x, y and the velocity of boxes of one scan in the LiDAR frame.

    Args:
        boxes: M boxes, rows of NaN without one.
        point_counts: (M,) numbers of their points.
        sizes: M sizes of their classes.
        config: Noise of sides.
    """
    away_m = np.linalg.norm(boxes.bottom_m[:, :2], axis=1)
    noise = (
        config.side_noise_m**2
        + (config.side_noise_per_m * away_m) ** 2
        + config.sparse_noise_m**2 / np.maximum(point_counts, 1)
    )
    covariances = np.full((len(boxes), 4, 4), np.nan)
    outlines_m = _outline_deviations(boxes, sizes, np.zeros(len(boxes), bool), config)
    hidden = _hidden_ends(boxes.yaw_rad, outlines_m, sizes)
    covariances[:, :2, :2] = hidden + noise[:, None, None] * np.eye(2)
    return covariances


def tracked_covariances(
    covariances: Float64,
    boxes: Boxes3D,
    sizes: SizePriors,
    is_confirmed: Bool,
    config: BoxUncertaintyConfig,
) -> Float64:
    """Return (T, 4, 4) covariances to report of x, y and the velocity of tracks.

    Args:
        covariances: (T, 4, 4) covariances of the tracker.
        boxes: T boxes in the same frame.
        sizes: T sizes of their classes.
        is_confirmed: (T,) Whether they are confirmed; the others have been seen in few scans.
        config: Shares of the tracker's variances.
    """
    shares = np.sqrt(np.repeat([config.track_share, config.velocity_share], 2))
    reported = covariances * np.outer(shares, shares)
    outlines_m = _outline_deviations(boxes, sizes, is_confirmed, config)
    reported[:, :2, :2] += _hidden_ends(boxes.yaw_rad, outlines_m, sizes)
    return np.asarray(reported)


def box_deviations(
    boxes: Boxes3D,
    point_counts: Int,
    sizes: SizePriors,
    has_moved: Bool,
    config: BoxUncertaintyConfig,
    is_confirmed: Bool | None = None,
) -> BoxDeviations:
    """Return the standard deviations of boxes in the LiDAR frame.

    Args:
        boxes: M boxes.
        point_counts: (M,) numbers of their points.
        sizes: M sizes of their classes.
        has_moved: (M,) Whether their motion has shown the front.
        config: Noise of sizes and headings.
        is_confirmed: (M,) Whether they are of confirmed tracks; None where none is.
    """
    has_sides = sizes.has_sides
    if is_confirmed is None:
        is_confirmed = np.zeros(len(boxes), bool)
    size_m = np.column_stack(
        [
            _outline_deviations(boxes, sizes, is_confirmed, config),
            _height_deviations(boxes, sizes, is_confirmed, config),
        ]
    )
    sparse_rad = config.sparse_axis_noise_rad / np.sqrt(np.maximum(point_counts, 1))
    standing = np.where(has_sides, config.traffic_reversal, config.person_reversal)
    return BoxDeviations(
        size_m,
        np.where(has_sides, np.hypot(config.axis_noise_rad, sparse_rad), _ANY_AXIS_RAD),
        np.where(has_moved, config.course_reversal, standing),
    )


def _outline_deviations(
    boxes: Boxes3D, sizes: SizePriors, is_confirmed: Bool, config: BoxUncertaintyConfig
) -> Float64:
    """Return (M, 2) standard deviations of lengths and widths."""
    share = np.where(is_confirmed, config.hidden_share, 1.0)
    mistakes = np.where(is_confirmed, 1.0, config.single_scan_mistakes)
    away_m = np.linalg.norm(boxes.bottom_m[:, :2], axis=1)
    outlines_m = sizes.deviations_m(boxes.size_m, share, mistakes)[:, :2]
    return np.asarray(np.hypot(outlines_m, config.size_noise_per_m * away_m[:, None]))


def _height_deviations(
    boxes: Boxes3D, sizes: SizePriors, is_confirmed: Bool, config: BoxUncertaintyConfig
) -> Float64:
    """Return (M,) standard deviations of heights: of what the class tells, returns leave a share that grows with distance."""
    mistakes = np.where(is_confirmed, 1.0, config.single_scan_mistakes)
    expected_m = np.column_stack([sizes.length_m[:, 0], sizes.width_m[:, 0], sizes.height_m[:, 0]])
    of_class_m = sizes.deviations_m(expected_m, np.ones(len(boxes)), mistakes)[:, 2]
    away_m = np.linalg.norm(boxes.bottom_m[:, :2], axis=1)
    near = np.where(sizes.has_sides, config.height_share, config.person_height_share)
    far = np.minimum(away_m / config.height_range_m, 1.0) ** 2
    return np.asarray(np.hypot(config.height_noise_m, of_class_m * np.hypot(near, far)))


def _hidden_ends(yaw_rad: Float64, outlines_m: Float64, sizes: SizePriors) -> Float64:
    """Return (M, 2, 2) covariances of centres by (M, 2) deviations of lengths and widths."""
    share = np.where(sizes.has_sides, 0.5, _CENTER_SHARE)
    deviations_m = share[:, None] * outlines_m
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    turn = np.stack([np.stack([cos, -sin], -1), np.stack([sin, cos], -1)], -2)
    return np.asarray((turn * deviations_m[:, None] ** 2) @ np.swapaxes(turn, -1, -2))
