"""The rows that one result adds to each table of a run; NaN and empty text where a value is not known."""

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from perception.geometry.boxes import transform_boxes
from perception.geometry.se3 import wrap
from perception.types import MODALITIES, Boxes3D, Float64, Int, Modality, PointState, Result, Tracks

# Column by name; all of one length.
Rows: TypeAlias = Mapping[str, NDArray[Any]]


def table_rows(result: Result, min_vehicle_score: float) -> dict[str, Rows]:
    """Return the new rows of each table that has some.

    Args:
        result: Result of the frame.
        min_vehicle_score: Score from which a vehicle is listed.
    """
    tracks = result.tracks
    tables = {
        "poses": _pose_rows(result),
        "tracks": {**_object_rows(result, tracks), "is_observed": tracks.is_observed},
        "timings": _timing_rows(result),
    }
    if result.vehicles is not None:
        tables["vehicles"] = _vehicle_rows(result, min_vehicle_score)
    tables["frames"] = _frame_rows(result, tables)
    frame, stamp_ns = result.frame.index, round(result.frame.stamp_s * 1e9)
    return {
        name: {
            "frame": np.full(count, frame, np.int32),
            "timestamp_ns": np.full(count, stamp_ns, np.int64),
            **rows,
        }
        for name, rows in tables.items()
        for count in [_length(rows)]
    }


def _frame_rows(result: Result, tables: Mapping[str, Rows]) -> Rows:
    frame, obstacles = result.frame, result.obstacles
    states = np.bincount(obstacles.point_states, minlength=len(PointState))
    values = {
        "name": frame.name,
        "number": frame.number,
        "has_image": frame.image is not None,
        "points": len(frame.points_velo),
        "invalid_points": frame.invalid_points,
        **{f"{state.name.lower()}_points": states[state] for state in PointState},
        "static_voxels": len(obstacles.static),
        "moving_voxels": len(obstacles.moving),
        "tracks": len(result.tracks),
        "vehicles": _length(tables["vehicles"]) if "vehicles" in tables else np.nan,
        "latency_s": result.duration_s,
        "health": result.health.level.name,
        "findings": "; ".join(map(str, result.health.findings)),
    }
    return {name: np.array([value]) for name, value in values.items()}


def _pose_rows(result: Result) -> Rows:
    world_SE3_velo = result.world_SE3_velo
    x, y, z, w = Rotation.from_matrix(world_SE3_velo[:3, :3]).as_quat(canonical=True)
    names = (
        "tx_m", "ty_m", "tz_m", "qw", "qx", "qy", "qz",
        "std_x_m", "std_y_m", "std_z_m", "std_rx_rad", "std_ry_rad", "std_rz_rad",
    )  # fmt: skip
    deviations = np.sqrt(np.diagonal(result.pose_covariance))
    values = (*world_SE3_velo[:3, 3], w, x, y, z, *deviations)
    return {name: np.array([value]) for name, value in zip(names, values, strict=True)}


def _vehicle_rows(result: Result, min_score: float) -> Rows:
    vehicles = result.vehicles
    assert vehicles is not None
    rows = np.flatnonzero(vehicles.fused.detections.scores >= min_score)
    fused, cameras = vehicles.fused[rows], vehicles.cameras[rows]  # -1 is no camera
    boxes_px = fused.detections.boxes_px
    if result.frame.calibration is None:
        boxes_px = np.full_like(boxes_px, np.nan)
    return {
        **_object_rows(result, vehicles.as_tracks(rows)),
        "existence": fused.existence,
        "camera": np.array([*(view.camera for view in result.frame.views), ""])[cameras],
        **dict(zip(("x1_px", "y1_px", "x2_px", "y2_px"), boxes_px.T, strict=True)),
        "dominant_modality": vehicles.dominant_modalities[rows],
        **{
            f"score_{modality}": _source_scores(result, modality, sources, cameras)
            for modality, sources in zip(MODALITIES, fused.source_indices.T, strict=True)
        },
        "score_bev": vehicles.bev_scores[rows],
        "points": vehicles.point_counts[rows],
        "distance_m": vehicles.distances_m[rows],
    }


def _timing_rows(result: Result) -> Rows:
    spans = {span.stage: span for span in result.spans}
    seconds = {**result.timings_s, **dict.fromkeys(result.skipped, np.nan)}
    known = [spans.get(stage) for stage in seconds]
    return {
        "stage": np.array(list(seconds), str),
        "worker": np.array([span.worker if span else "" for span in known], str),
        "start_s": np.array([span.start_s if span else np.nan for span in known]),
        "duration_s": np.array(list(seconds.values()), float),
        "is_skipped": np.array([stage in result.skipped for stage in seconds], bool),
    }


def _object_rows(result: Result, tracks: Tracks) -> Rows:
    """Return the columns that tracks and vehicles share."""
    world_SE3_velo, velocities_velo = result.world_SE3_velo, tracks.velocities_m_s
    boxes_world = transform_boxes(world_SE3_velo, tracks.boxes)
    variances = np.diagonal(tracks.covariances, axis1=1, axis2=2)
    deviations = ("std_x_velo_m", "std_y_velo_m", "std_vx_velo_m_s", "std_vy_velo_m_s")
    sizes = ("std_length_m", "std_width_m", "std_height_m")
    return {
        "track_id": np.where(tracks.ids >= 0, tracks.ids.astype(float), np.nan),
        "category": tracks.types,
        "score": tracks.scores,
        **dict(zip(("length_m", "width_m", "height_m"), tracks.boxes.size_m.T, strict=True)),
        "speed_m_s": np.linalg.norm(velocities_velo, axis=1),
        **_place_rows("velo", tracks.boxes, velocities_velo),
        **_place_rows("world", boxes_world, velocities_velo @ world_SE3_velo[:2, :2].T),
        **dict(zip(deviations, np.sqrt(variances).T, strict=True)),
        **dict(zip(sizes, tracks.box_deviations.size_m.T, strict=True)),
        "std_yaw_rad": tracks.box_deviations.yaw_rad,
        "reversal": tracks.box_deviations.reversal,
    }


def _place_rows(frame: str, boxes: Boxes3D, velocities_m_s: Float64) -> Rows:
    x_m, y_m, z_m = boxes.bottom_m.T
    vx_m_s, vy_m_s = velocities_m_s.T
    return {
        f"x_{frame}_m": x_m,
        f"y_{frame}_m": y_m,
        f"z_{frame}_m": z_m,
        f"yaw_{frame}_rad": wrap(boxes.yaw_rad),
        f"vx_{frame}_m_s": vx_m_s,
        f"vy_{frame}_m_s": vy_m_s,
    }


def _source_scores(
    result: Result, modality: Modality, sources: NDArray[np.int64], cameras: Int
) -> Float64:
    """Return the scores of a detector at the rows of its detections in each camera; NaN where it has none."""
    scores = np.full(len(sources), np.nan)
    for camera in np.unique(cameras).tolist():
        has_source = (sources >= 0) & (cameras == camera)
        if has_source.any():
            found = result.detections_in(camera)[modality]
            scores[has_source] = found.scores[sources[has_source]]
    return scores


def _length(rows: Rows) -> int:
    return len(next(iter(rows.values())))
