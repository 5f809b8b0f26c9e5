"""Uncertainty of reported boxes of vehicles and people: centre, size, heading, and which end is the front.

A LiDAR sees the ends that face it. A hidden end is where the size of the class puts it, and whatever the number of scans, it
stays hidden: half of the error of the size is that of the centre. A person's middle is among the returns instead.
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
    covariances[:, :2, :2] = _hidden_ends(boxes.yaw_rad, sizes) + noise[:, None, None] * np.eye(2)
    return covariances


def tracked_covariances(
    covariances: Float64, yaw_rad: Float64, sizes: SizePriors, config: BoxUncertaintyConfig
) -> Float64:
    """Return (T, 4, 4) covariances to report of x, y and the velocity of tracks.

    Args:
        covariances: (T, 4, 4) covariances of the tracker.
        yaw_rad: (T,) headings in the same frame.
        sizes: T sizes of their classes.
        config: Shares of the tracker's variances.
    """
    shares = np.sqrt(np.repeat([config.track_share, config.velocity_share], 2))
    reported = covariances * np.outer(shares, shares)
    reported[:, :2, :2] += _hidden_ends(yaw_rad, sizes)
    return np.asarray(reported)


def box_deviations(
    boxes: Boxes3D,
    point_counts: Int,
    sizes: SizePriors,
    has_moved: Bool,
    config: BoxUncertaintyConfig,
) -> BoxDeviations:
    """Return the standard deviations of boxes in the LiDAR frame.

    Args:
        boxes: M boxes.
        point_counts: (M,) numbers of their points.
        sizes: M sizes of their classes.
        has_moved: (M,) Whether their motion has shown the front.
        config: Noise of sizes and headings.
    """
    has_sides, away_m = sizes.has_sides, np.linalg.norm(boxes.bottom_m[:, :2], axis=1)
    size_m = np.column_stack(
        [
            config.length_ratio * sizes.length_m[:, 1],
            sizes.width_m[:, 1],
            np.full(len(boxes), config.height_noise_m),
        ]
    )
    sparse_rad = config.sparse_axis_noise_rad / np.sqrt(np.maximum(point_counts, 1))
    standing = np.where(has_sides, config.traffic_reversal, config.person_reversal)
    return BoxDeviations(
        np.hypot(size_m, config.size_noise_per_m * away_m[:, None]),
        np.where(has_sides, np.hypot(config.axis_noise_rad, sparse_rad), _ANY_AXIS_RAD),
        np.where(has_moved, config.course_reversal, standing),
    )


def _hidden_ends(yaw_rad: Float64, sizes: SizePriors) -> Float64:
    """Return (M, 2, 2) covariances of centres by ends that are placed by the size of the class."""
    share = np.where(sizes.has_sides, 0.5, _CENTER_SHARE)
    deviations_m = share[:, None] * np.column_stack([sizes.length_m[:, 1], sizes.width_m[:, 1]])
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    turn = np.stack([np.stack([cos, -sin], -1), np.stack([sin, cos], -1)], -2)
    return np.asarray((turn * deviations_m[:, None] ** 2) @ np.swapaxes(turn, -1, -2))
