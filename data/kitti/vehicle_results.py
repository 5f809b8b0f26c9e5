"""Followed vehicles as result rows of KITTI's tracking benchmark: boxes in the image, and on the road."""

import numpy as np

from data.kitti.labels import alphas_rad, boxes_to_cam
from data.kitti.tracking_rows import TrackingRows
from perception.types import Calibration, Float64, Vehicles

# What the format says of what a tracker does not know.
_NO_LEVEL, _NO_SIZE, _NO_PLACE, _NO_ANGLE = -1.0, -1.0, -1000.0, -10.0


def to_vehicle_rows(
    frame: int, vehicles: Vehicles, calibration: Calibration, least_score: float = 0.0
) -> TrackingRows:
    """Return a row for each vehicle that has an id; of one without a 3D box, the box in the image alone.

    Args:
        frame: its number.
        vehicles: of the frame.
        calibration: of the camera.
        least_score: of a row.
    """
    detections = vehicles.fused.detections
    rows = np.flatnonzero((vehicles.ids >= 0) & (detections.scores >= least_score))
    boxes, detections = vehicles.boxes[rows], detections[rows]
    columns = boxes_to_cam(boxes, calibration)
    unknown = np.full(len(rows), _NO_LEVEL)
    return TrackingRows(
        frames=np.full(len(rows), frame, np.int64),
        ids=vehicles.ids[rows],
        types=detections.types,
        truncation=unknown,
        occlusion=unknown,
        alphas_rad=_known(alphas_rad(boxes, columns[:, 6]), _NO_ANGLE),
        boxes_px=detections.boxes_px,
        sizes_hwl_m=_known(columns[:, :3], _NO_SIZE),
        bottoms_cam_m=_known(columns[:, 3:6], _NO_PLACE),
        headings_rad=_known(columns[:, 6], _NO_ANGLE),
        scores=detections.scores,
    )


def _known(values: Float64, otherwise: float) -> Float64:
    return np.where(np.isfinite(values), values, otherwise)
