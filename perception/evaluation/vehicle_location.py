"""Errors of detected vehicles on the road: position, heading and distance of those that match a true vehicle."""

from dataclasses import dataclass

import numpy as np

from perception.geometry.box_overlap_px import iou_px
from perception.geometry.boxes import points_inside
from perception.geometry.se3 import wrap
from perception.tracking.association import assign_hungarian
from perception.types import ArrayTable, Boxes3D, Float, Float64, Vehicles

# KITTI's labels are tight: points on a side of the box may lie outside.
_MARGIN_M = 0.1


@dataclass(frozen=True)
class LocationErrors(ArrayTable):
    """Errors of N detected true vehicles; NaN where the detection has no box or no return.

    Attributes:
        range_m: (N,) Distance from the LiDAR to the true centre over the ground.
        center_m: (N,) Distance of the centres over the ground.
        yaw_rad: (N,) Absolute heading error, 0 to pi.
        axis_rad: (N,) Absolute error of the box's axis, 0 to pi/2: front and rear are not distinguished.
        distance_m: (N,) Absolute error of the reported distance against the nearest return in the true box.
    """

    range_m: Float64
    center_m: Float64
    yaw_rad: Float64
    axis_rad: Float64
    distance_m: Float64


def location_errors(
    vehicles: Vehicles,
    true_px: Float64,
    true_boxes: Boxes3D,
    points_velo: Float,
    min_iou: float = 0.5,
) -> LocationErrors:
    """Measure the vehicles of one frame that match a true vehicle in the image.

    Args:
        vehicles: Detected vehicles in the LiDAR frame.
        true_px: (T, 4) True boxes x1 y1 x2 y2 in the image.
        true_boxes: (T) True boxes in the LiDAR frame.
        points_velo: (N, 3+) Points of the scan in the LiDAR frame.
        min_iou: Overlap (IoU) in the image of a matched pair, 0 to 1.
    """
    iou = iou_px(true_px, vehicles.fused.detections.boxes_px)
    pairs = assign_hungarian(1.0 - iou, iou >= min_iou)
    true, found = true_boxes[pairs.tracks], vehicles.boxes[pairs.detections]
    center_offsets_m = found.bottom_m[:, :2] - true.bottom_m[:, :2]
    turn_rad = found.yaw_rad - true.yaw_rad
    nearest_m = np.array(
        [_nearest_m(points_velo[inside]) for inside in points_inside(true, points_velo, _MARGIN_M)]
    )
    return LocationErrors(
        range_m=np.hypot(true.bottom_m[:, 0], true.bottom_m[:, 1]),
        center_m=np.hypot(center_offsets_m[:, 0], center_offsets_m[:, 1]),
        yaw_rad=np.abs(wrap(turn_rad)),
        axis_rad=np.abs(wrap(turn_rad, np.pi)),
        distance_m=np.abs(vehicles.distances_m[pairs.detections] - nearest_m.reshape(-1)),
    )


def _nearest_m(points: Float) -> float:
    return float(np.linalg.norm(points[:, :3], axis=1).min()) if len(points) else np.nan
