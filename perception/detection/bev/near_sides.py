"""Vehicles seen from above that are turned to their returns, and whose near sides are moved to these.

         ┌──────────┐ far end, by the network
         │          │
returns  ·          │     A side that faces the sensor ends where the returns end. The network, of cells of 0.2 m, errs
         ·──·──·──·─┘     by more than that; the far side follows by half, as position and size share the error.
          sensor            Its axis is the one along which most returns lie on these sides, by its own and what it states
                            of its error.
"""

from dataclasses import replace

import numpy as np

from perception.detection.bev.boxes import AXIS, BevDetections
from perception.geometry.se3 import wrap
from perception.kernels.near_sides import near_sides
from perception.types import Bool, Boxes3D, Float32

_LOW_M, _MARGIN_M, _MIN_RETURNS = 0.25, 0.5, 8
_MIN_AXIS_RAD = 0.03  # minimum standard deviation of an axis by the network
_MAX_M = 0.5  # largest distance by which a side is moved
_FAR = 0.5  # share of it by which the far side follows


def fit_near_sides(
    found: BevDetections, is_vehicle: Bool, points_velo: Float32, heights_m: Float32
) -> BevDetections:
    """Return objects of which vehicles are turned to their returns, and their near sides moved to these.

    Args:
        found: M objects, their bottoms above the ground.
        is_vehicle: (M,) which of them have flat sides.
        points_velo: (N, 4) points.
        heights_m: (N,) heights above the ground.
    """
    rows, boxes, deviations = np.flatnonzero(is_vehicle), found.boxes, found.deviations.copy()
    columns = np.column_stack([boxes.bottom_m, boxes.size_m, boxes.yaw_rad])[rows]
    axis_rad = np.maximum(deviations[rows, AXIS], _MIN_AXIS_RAD)
    turns_rad, deviations[rows, AXIS], *edges_m = near_sides(
        points_velo, heights_m, columns, axis_rad, _LOW_M, _MARGIN_M, _MIN_RETURNS
    ).T
    moves_m = np.column_stack(edges_m) - columns[:, 3:5] / 2
    moves_m = np.nan_to_num(np.clip(moves_m, -_MAX_M, _MAX_M))
    yaw_rad = boxes.yaw_rad.copy()
    yaw_rad[rows] = wrap(columns[:, 6] + turns_rad)
    cos, sin = np.cos(yaw_rad[rows]), np.sin(yaw_rad[rows])
    axes = np.stack([np.stack([cos, sin], axis=1), np.stack([-sin, cos], axis=1)], axis=1)
    towards = -np.sign((axes * columns[:, None, :2]).sum(axis=2))
    bottom_m, size_m = boxes.bottom_m.copy(), boxes.size_m.copy()
    size_m[rows, :2] += (1 - _FAR) * moves_m
    bottom_m[rows, :2] += (1 + _FAR) / 2 * ((towards * moves_m)[:, :, None] * axes).sum(axis=1)
    return replace(found, boxes=Boxes3D(bottom_m, size_m, yaw_rad), deviations=deviations)
