"""Tracks as result rows of KITTI's tracking benchmark, which knows of nothing but what the camera sees."""

import numpy as np

from data.kitti.labels import alphas_rad, boxes_to_cam
from data.kitti.tracking_rows import TrackingRows
from perception.geometry.boxes import edges
from perception.geometry.segments import outlines_px, project_segments
from perception.types import Bool, Boxes3D, Calibration, Float64, Tracks

# The author's classes by volume: h w l of a pedestrian, and of a cyclist, at most. Else it is a vehicle.
_PEDESTRIAN_M3 = 1.8
_CYCLIST_M3 = 4.0
# Of a track that was measured in this scan, and of one that is only predicted.
_OBSERVED_SCORE = 1.0
_PREDICTED_SCORE = 0.5
# The rows do not say how much of an object is cut off or hidden.
_UNKNOWN = -1.0


def to_tracking_rows(
    frame: int, tracks: Tracks, calibration: Calibration, image_size_px: tuple[int, int]
) -> TrackingRows:
    """Return a row for each track of which the image shows a part.

    Args:
        frame: its number.
        tracks: at the moment of the frame.
        calibration: of the camera.
        image_size_px: (width, height).
    """
    boxes_px = image_boxes(tracks.boxes, calibration, image_size_px)
    is_in_view: Bool = np.asarray((boxes_px[:, 2:] > boxes_px[:, :2]).all(axis=1))
    tracks, boxes_px = tracks[is_in_view], boxes_px[is_in_view]
    columns = boxes_to_cam(tracks.boxes, calibration)
    unknown = np.full(len(tracks), _UNKNOWN)
    return TrackingRows(
        frames=np.full(len(tracks), frame, np.int64),
        ids=tracks.ids,
        types=types_by_volume(tracks.boxes),
        truncation=unknown,
        occlusion=unknown,
        alphas_rad=alphas_rad(tracks.boxes, columns[:, 6]),
        boxes_px=boxes_px,
        sizes_hwl_m=columns[:, :3],
        bottoms_cam_m=columns[:, 3:6],
        headings_rad=columns[:, 6],
        scores=np.where(tracks.is_observed, _OBSERVED_SCORE, _PREDICTED_SCORE),
    )


def types_by_volume(boxes: Boxes3D) -> np.ndarray:
    """Name each box Pedestrian, Cyclist or Car by its volume alone, as the author's program does."""
    volumes_m3 = boxes.size_m.prod(axis=1)
    return np.select(
        [volumes_m3 <= _PEDESTRIAN_M3, volumes_m3 <= _CYCLIST_M3], ["Pedestrian", "Cyclist"], "Car"
    )


def image_boxes(
    boxes_velo: Boxes3D, calibration: Calibration, image_size_px: tuple[int, int]
) -> Float64:
    """Return (M, 4) x1 y1 x2 y2 around what the image shows of each box; x1 >= x2 or y1 >= y2 for nothing.

    What lies behind the camera is cut off before the rest is projected.
    """
    segments = edges(boxes_velo)
    seen = project_segments(calibration.image_P_velo, segments.reshape(-1, 2, 3))
    owners = seen.rows // segments.shape[1]
    outlines = outlines_px(seen.ends_px, owners, len(boxes_velo))
    last_px = np.array(image_size_px) - 1.0
    return np.asarray(np.clip(outlines, 0, np.tile(last_px, 2)))
