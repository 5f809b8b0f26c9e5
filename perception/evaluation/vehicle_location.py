"""How far off detected vehicles are on the road: the place, the heading and the distance of each that is true."""

from dataclasses import dataclass

import numpy as np

from perception.evaluation.rows import Rows
from perception.geometry.angles import wrap
from perception.geometry.box_overlap_px import iou_px
from perception.geometry.boxes import points_inside
from perception.tracking.association import assign_hungarian
from perception.types import Boxes3D, Float, Float64, Vehicles

# KITTI's labels are tight: what lies on a side may be counted outside.
_MARGIN_M = 0.1


@dataclass(frozen=True)
class LocationErrors(Rows):
    """N true vehicles that were detected; NaN where the detection has no box or no return.

    Attributes:
        range_m: (N,) from the LiDAR to the true centre, over the ground.
        center_m: (N,) between the centres, over the ground.
        yaw_rad: (N,) between the headings.
        axis_rad: (N,) the same where front and rear are not told apart.
        distance_m: (N,) between the told distance and that of the nearest return in the true box.
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
    """Measure the vehicles of one frame that are detected where the image shows a true one.

    Args:
        vehicles: in the frame of the scan.
        true_px: (T, 4) true boxes in the image.
        true_boxes: (T) the same in the scan.
        points_velo: (N, 3+) the scan.
        min_iou: of a pair, in the image.
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
