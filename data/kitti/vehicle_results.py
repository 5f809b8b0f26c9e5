"""Located vehicles as result rows of KITTI's benchmarks: the object benchmark's, and the tracking one's."""

import numpy as np

from data.kitti.labels import alphas_rad, boxes_to_cam
from data.kitti.tracking_rows import TrackingRows, format_result_rows
from perception.types import Calibration, Float64, Vehicles

# What the formats say of what is not known.
_NO_LEVEL, _NO_SIZE, _NO_PLACE, _NO_ANGLE = -1.0, -1.0, -1000.0, -10.0


def to_vehicle_rows(
    frame: int, vehicles: Vehicles, calibration: Calibration, min_score: float = 0.0
) -> TrackingRows:
    """Return a row for each vehicle that has an id; of one without a 3D box, the box in the image alone.

    Args:
        frame: its number.
        vehicles: of the frame.
        calibration: of the camera.
        min_score: of a row.
    """
    rows = _all_rows(frame, vehicles, calibration)
    return rows[(rows.ids >= 0) & (rows.scores >= min_score)]


def format_object_rows(vehicles: Vehicles, calibration: Calibration) -> str:
    """Return the rows of one frame for the object benchmark, 16 columns each, with its line end.

    Every vehicle has one, followed or not: the benchmark judges the whole range of scores.
    """
    # The columns of the tracking benchmark, less frame and id.
    lines = format_result_rows(_all_rows(0, vehicles, calibration)).splitlines()
    return "".join(f"{line.split(' ', 2)[2]}\n" for line in lines)


def _all_rows(frame: int, vehicles: Vehicles, calibration: Calibration) -> TrackingRows:
    detections, boxes = vehicles.fused.detections, vehicles.boxes
    columns = boxes_to_cam(boxes, calibration)
    unknown = np.full(len(vehicles), _NO_LEVEL)
    return TrackingRows(
        frames=np.full(len(vehicles), frame, np.int64),
        ids=vehicles.ids,
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
