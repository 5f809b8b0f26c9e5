"""Vehicles seen from above whose near sides are moved to their returns.

         ┌──────────┐ far end, by the network
         │          │
returns  ·          │     A side that faces the sensor ends where the returns end. The network, of cells of 0.2 m, errs
         ·──·──·──·─┘     by more than that; the far side follows by half, as position and size share the error.
          sensor
"""

from dataclasses import replace

import numpy as np

from perception.detection.bev.boxes import BevDetections
from perception.kernels.bev import near_edges
from perception.types import Bool, Float32

_LOW_M, _MARGIN_M, _MIN_RETURNS = 0.25, 0.35, 8
_MAX_M = 0.35  # largest distance by which a side is moved
_FAR = 0.5  # share of it by which the far side follows


def fit_near_sides(
    found: BevDetections, is_vehicle: Bool, points_velo: Float32, heights_m: Float32
) -> BevDetections:
    """Return objects of which the near sides of vehicles are moved to their returns.

    Args:
        found: M objects, their bottoms above the ground.
        is_vehicle: (M,) which of them have flat sides.
        points_velo: (N, 4) points.
        heights_m: (N,) heights above the ground.
    """
    rows, boxes = np.flatnonzero(is_vehicle), found.boxes
    columns = np.column_stack([boxes.bottom_m, boxes.size_m, boxes.yaw_rad])[rows]
    edges_m = near_edges(points_velo, heights_m, columns, _LOW_M, _MARGIN_M, _MIN_RETURNS)
    moves_m = np.nan_to_num(np.clip(edges_m - columns[:, 3:5] / 2, -_MAX_M, _MAX_M))
    cos, sin = np.cos(columns[:, 6]), np.sin(columns[:, 6])
    axes = np.stack([np.stack([cos, sin], axis=1), np.stack([-sin, cos], axis=1)], axis=1)
    towards = -np.sign((axes * columns[:, None, :2]).sum(axis=2))
    bottom_m, size_m = boxes.bottom_m.copy(), boxes.size_m.copy()
    size_m[rows, :2] += (1 - _FAR) * moves_m
    bottom_m[rows, :2] += (1 + _FAR) / 2 * ((towards * moves_m)[:, :, None] * axes).sum(axis=1)
    return replace(found, boxes=replace(boxes, bottom_m=bottom_m, size_m=size_m))
