"""Views all round the LiDAR, in which vehicles that no camera shows are tracked as those that one shows.

Numbers after those of the cameras: 0 ahead, 1 to the left, 2 behind, 3 to the right, with wide overlaps.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from perception.geometry.camera import box_outlines_px
from perception.tracking.vehicles.observations import FrameGeometry
from perception.types import Float64, Vehicles

_VIEWS = 4
_FOCAL_PX = 700.0
_SIZE_PX = (4200, 2800)  # 143 by 127 degrees: no box that a view is chosen for ends at its border
_CAM_R_VELO = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])


def surround_views(stamp_s: float, world_SE3_velo: Float64) -> list[FrameGeometry]:
    """Return the geometry of each view at the time and the pose of a scan."""
    middle_px = np.array(
        [[_FOCAL_PX, 0, _SIZE_PX[0] / 2], [0, _FOCAL_PX, _SIZE_PX[1] / 2], [0, 0, 1]]
    )
    views = []
    for number in range(_VIEWS):
        turn_rad = 2 * np.pi * number / _VIEWS
        cos, sin = np.cos(turn_rad), np.sin(turn_rad)
        ahead_R_velo = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
        image_P_velo = np.column_stack([middle_px @ _CAM_R_VELO @ ahead_R_velo, np.zeros(3)])
        views.append(FrameGeometry(stamp_s, world_SE3_velo, image_P_velo, _SIZE_PX))
    return views


def with_views(vehicles: Vehicles, views: Sequence[FrameGeometry], first: int) -> Vehicles:
    """Return vehicles of which those in no image are in that of the view that looks at them.

    Args:
        vehicles: M vehicles.
        views: Views all round.
        first: Number of the first of them.
    """
    rows = np.flatnonzero(vehicles.cameras < 0)
    if not len(rows):
        return vehicles
    x_m, y_m, _ = vehicles.boxes.bottom_m[rows].T
    numbers = np.round(np.arctan2(y_m, x_m) * _VIEWS / (2 * np.pi)).astype(np.int64) % _VIEWS
    cameras = vehicles.cameras.copy()
    boxes_px = vehicles.fused.detections.boxes_px.copy()
    cameras[rows] = first + numbers
    seen = FrameGeometry.of_rows(views, numbers)
    boxes_px[rows] = box_outlines_px(seen.image_P_velo, vehicles.boxes[rows], _SIZE_PX)
    return replace(vehicles.with_detections(boxes_px=boxes_px), cameras=cameras)


def without_views(vehicles: Vehicles, first: int) -> Vehicles:
    """Return vehicles of which those in the images of views all round are in none."""
    is_in_view = vehicles.cameras >= first
    if not is_in_view.any():
        return vehicles
    boxes_px = np.where(is_in_view[:, None], np.nan, vehicles.fused.detections.boxes_px)
    cameras = np.where(is_in_view, -1, vehicles.cameras)
    return replace(vehicles.with_detections(boxes_px=boxes_px), cameras=cameras)
