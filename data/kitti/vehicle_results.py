"""Located vehicles as result rows of KITTI's benchmarks: the object benchmark's, and for tracks the tracking one's."""

import numpy as np

from data.kitti.labels import alphas_rad, boxes_to_cam
from data.kitti.tracking_rows import TrackingRows, format_result_rows
from perception.types import Bool, Calibration, Vehicles

# What the rows do not say, and h w l x y z ry of what has no box in space.
_UNKNOWN = -1.0
_UNKNOWN_ALPHA_RAD = -10.0
_NOWHERE = (-1.0, -1.0, -1.0, -1000.0, -1000.0, -1000.0, -10.0)


def vehicle_rows(frame: int, vehicles: Vehicles, calibration: Calibration) -> TrackingRows:
    """Return a row for each of M vehicles; those that are not followed have the id -1.

    Args:
        frame: its number.
        vehicles: located ones.
        calibration: of the camera.
    """
    found, boxes = vehicles.fused.detections, vehicles.boxes
    columns = boxes_to_cam(boxes, calibration)
    alphas = alphas_rad(boxes, columns[:, 6])
    is_known: Bool = np.asarray(np.isfinite(columns).all(axis=1))
    columns = np.where(is_known[:, None], columns, _NOWHERE)
    return TrackingRows(
        frames=np.full(len(found), frame, np.int64),
        ids=vehicles.ids,
        types=found.types,
        truncation=np.full(len(found), _UNKNOWN),
        occlusion=np.full(len(found), _UNKNOWN),
        alphas_rad=np.where(is_known, alphas, _UNKNOWN_ALPHA_RAD),
        boxes_px=found.boxes_px,
        sizes_hwl_m=columns[:, :3],
        bottoms_cam_m=columns[:, 3:6],
        headings_rad=columns[:, 6],
        scores=found.scores,
    )


def format_object_rows(rows: TrackingRows) -> str:
    """Return the 16 columns of the object benchmark of one frame's rows, each with its line end.

    They are those of the tracking benchmark without frame and id.
    """
    lines = format_result_rows(rows).splitlines()
    return "".join(f"{line.split(' ', 2)[2]}\n" for line in lines)


def format_track_rows(rows: TrackingRows) -> str:
    """Return the 18 columns of the tracking benchmark of the rows that belong to a track."""
    return format_result_rows(rows[rows.ids >= 0])
