"""Objects of a frame as result rows of KITTI's tracking benchmark (18 columns) and object benchmark (16 columns)."""

from dataclasses import replace

import numpy as np

from data.kitti.labels import boxes_to_cam
from data.kitti.tracking_rows import TrackingRows, format_result_rows
from data.results.objects import as_tracks
from perception.geometry.boxes import (
    observation_angles_rad,
    usual_observation_angles_rad,
)
from perception.geometry.camera import box_outlines_px
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import Bool, Boxes3D, Calibration, Detections, Float64, Int, Tracks, Vehicles

# Upper volumes of the author's classes, height x width x length; a larger box is a car.
_PEDESTRIAN_M3 = 1.8
_CYCLIST_M3 = 4.0
# Scores of a track that is measured in the scan, and of one that is predicted.
_OBSERVED_SCORE, _PREDICTED_SCORE = 1.0, 0.5
# Trackers are evaluated on all their rows, whatever the score.
_MIN_EXISTENCE = 0.5
# Values of unknown columns: levels and sizes, positions, angles.
_UNKNOWN, _UNKNOWN_POSITION_M, _UNKNOWN_ANGLE_RAD = -1.0, -1000.0, -10.0


def track_rows(frame: int, tracks: Tracks, calibration: Calibration) -> TrackingRows:
    """Return a row for each track that is partly in the image; none where the size of the image is not known."""
    if calibration.image_size_px is None:
        return TrackingRows.empty()
    boxes_px = box_outlines_px(calibration.image_P_velo, tracks.boxes, calibration.image_size_px)
    is_in_view = np.flatnonzero(np.isfinite(boxes_px).all(axis=1))
    tracks, boxes_px = tracks[is_in_view], boxes_px[is_in_view]
    detections = Detections(boxes_px, _scores(tracks.is_observed), types_by_volume(tracks.boxes))
    return _rows(frame, tracks.ids, tracks.boxes, detections, calibration)


def vehicle_rows(frame: int, vehicles: Vehicles, calibration: Calibration) -> TrackingRows:
    """Return a row for each vehicle that has an id and exists more likely than not.

    The score is that probability, not that of a fitting box. Without a 3D box, only the rectangle is known.
    """
    detections = replace(vehicles.fused.detections, scores=vehicles.fused.existence)
    rows = _rows(frame, vehicles.ids, vehicles.boxes, detections, calibration)
    return rows[(rows.ids >= 0) & (rows.scores >= _MIN_EXISTENCE)]


def trajectory_rows(
    frame: int,
    tracked: TrackedObject,
    object_id: int,
    kind: str | None,
    calibration: Calibration,
) -> TrackingRows:
    """Return the row of one tracked object, or none where it is lost or not in the image.

    Args:
        frame: Index of the frame.
        tracked: Object in the frame.
        object_id: Track id of the row.
        kind: KITTI type of the row; None to classify by the size of the box.
        calibration: Camera calibration with the size of the image.
    """
    track, rows = as_tracks(tracked, object_id), TrackingRows.empty()
    if tracked.status is TrackStatus.LOST:
        return rows
    if tracked.box_velo is not None:
        rows = track_rows(frame, track, calibration)
    elif tracked.box_px is not None:
        scores = _scores(track.is_observed)
        detections = Detections(tracked.box_px[None], scores, np.array(["Misc"]))
        rows = _rows(frame, track.ids, track.boxes, detections, calibration)
    return rows if kind is None else replace(rows, types=np.full(len(rows), kind))


def format_object_rows(vehicles: Vehicles, calibration: Calibration) -> str:
    """Return the rows of one frame for the object benchmark.

    Every vehicle has a row, tracked or not: average precision needs the whole range of scores. And every row has an
    observation angle, the usual one without a 3D box: the orientation is not measured where one is unknown.
    """
    # The columns of the tracking benchmark without frame and id.
    detections = vehicles.fused.detections
    rows = _rows(0, vehicles.ids, vehicles.boxes, detections, calibration)
    usual_rad = usual_observation_angles_rad(detections.boxes_px, calibration)
    is_unknown = rows.alphas_rad == _UNKNOWN_ANGLE_RAD
    rows = replace(rows, alphas_rad=np.where(is_unknown, usual_rad, rows.alphas_rad))
    lines = format_result_rows(rows).splitlines()
    return "".join(f"{line.split(' ', 2)[2]}\n" for line in lines)


def types_by_volume(boxes: Boxes3D) -> np.ndarray:
    """Classify each box as Pedestrian, Cyclist or Car by its volume, as the author's program does."""
    volumes_m3 = boxes.size_m.prod(axis=1)
    return np.select(
        [volumes_m3 <= _PEDESTRIAN_M3, volumes_m3 <= _CYCLIST_M3], ["Pedestrian", "Cyclist"], "Car"
    )


def _rows(
    frame: int, ids: Int, boxes_velo: Boxes3D, detections: Detections, calibration: Calibration
) -> TrackingRows:
    """Return rows of KITTI; truncation and occlusion, and boxes of NaN, get the values of unknown ones."""
    columns, unknown = boxes_to_cam(boxes_velo, calibration), np.full(len(ids), _UNKNOWN)
    return TrackingRows(
        frames=np.full(len(ids), frame, np.int64),
        ids=ids,
        types=detections.types,
        truncation=unknown,
        occlusion=unknown,
        alphas_rad=_known(observation_angles_rad(boxes_velo), _UNKNOWN_ANGLE_RAD),
        boxes_px=detections.boxes_px,
        sizes_hwl_m=_known(columns[:, :3], _UNKNOWN),
        bottoms_cam_m=_known(columns[:, 3:6], _UNKNOWN_POSITION_M),
        headings_rad=_known(columns[:, 6], _UNKNOWN_ANGLE_RAD),
        scores=detections.scores,
    )


def _known(values: Float64, otherwise: float) -> Float64:
    return np.where(np.isfinite(values), values, otherwise)


def _scores(is_observed: Bool) -> Float64:
    return np.where(is_observed, _OBSERVED_SCORE, _PREDICTED_SCORE)
