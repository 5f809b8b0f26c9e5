"""What the Rerun viewer shows of a result: entities by path, each logged anew in every frame.

    world                         origin at the first position of the LiDAR
    +- ego                        pose of the LiDAR
    |  +- lidar/{outside,ground,static,moving}
    |  +- camera                  pinhole
    |  |  +- image, dm, rm        image and maps
    |  |  `- detections/{rgb,dm,rm,fused}
    |  `- cameras/NAME            the same of each further camera
    +- tracks, vehicles           boxes; vehicles that no track stands for
    `- velocities, path
    timings, counts, health       series

Their number does not grow with the drive: all tracks are one entity.
"""

from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np
import rerun as rr

from perception.detection.vehicles.camera_views import views_of
from perception.geometry import se3
from perception.geometry.boxes import transform_boxes
from perception.render import palette
from perception.render.palette import Color
from perception.tracking.vehicles.duplicates import distinct_rows
from perception.types import (
    SENSOR_PARTS,
    Boxes3D,
    Calibration,
    Detections,
    Float64,
    Modality,
    PointState,
    Result,
    Tracks,
    UInt8,
)

# Entities of a frame by path.
Entities = dict[str, Any]

POINT_COLORS: Mapping[PointState, Color] = {
    PointState.OUTSIDE: palette.GRID,
    PointState.GROUND: palette.GROUND_POINTS,
    PointState.STATIC: palette.STATIC,
    PointState.MOVING: palette.MOVING,
}
_MODALITY_COLORS: Mapping[Modality, Color] = {
    "rgb": palette.CLASSES["Car"],
    "dm": palette.CLASSES["Cyclist"],
    "rm": palette.CLASSES["Pedestrian"],
}
CAMERA = "world/ego/camera"
_POINT_RADIUS = rr.Radius.ui_points(1.2)  # the same size near and far
_JPEG_QUALITY = 85


def point_entities(result: Result) -> Entities:
    """Return the points of the scan by their states, in the LiDAR frame."""
    points_velo, states = result.frame.points_velo[:, :3], result.obstacles.point_states
    points = {state: points_velo[states == state] for state in POINT_COLORS}
    # Points without a return are at the origin.
    outside = points[PointState.OUTSIDE]
    points[PointState.OUTSIDE] = outside[outside.any(axis=1)]
    return {
        f"world/ego/lidar/{state.name.lower()}": rr.Points3D(
            points[state], colors=color, radii=_POINT_RADIUS
        )
        for state, color in POINT_COLORS.items()
    }


def pose_entities(result: Result, origin_m: Float64) -> Entities:
    """Return the pose of the LiDAR, and its position as a point of its path.

    Args:
        result: Result of the frame.
        origin_m: (3,) world position of Rerun's origin, since its coordinates are in single precision.
    """
    rotation, position_m = result.world_SE3_velo[:3, :3], result.world_SE3_velo[:3, 3] - origin_m
    return {
        "world/ego": rr.Transform3D(translation=position_m, mat3x3=rotation),
        "world/path": rr.Points3D([position_m], colors=palette.EGO_PATH, radii=0.1),
    }


def object_entities(result: Result, origin_m: Float64, display_score: float) -> Entities:
    """Return boxes, ids and velocities of the tracks, and of the vehicles that no track stands for.

    Args:
        result: Result of the frame.
        origin_m: (3,) world position of Rerun's origin.
        display_score: Score from which a vehicle is shown.
    """
    vehicles = Tracks.empty()
    if result.vehicles is not None:
        rows = distinct_rows(result.vehicles, display_score)
        is_shown = np.isfinite(result.vehicles.boxes.yaw_rad[rows])
        is_shown &= ~np.isin(result.vehicles.ids[rows], result.tracks.ids)
        vehicles = result.vehicles.as_tracks(rows[is_shown])
    origin_SE3_velo = result.world_SE3_velo.copy()
    origin_SE3_velo[:3, 3] -= origin_m
    boxes = transform_boxes(origin_SE3_velo, result.tracks.boxes)
    velocities_m_s = result.tracks.velocities_m_s @ origin_SE3_velo[:2, :2].T
    return {
        "world/tracks": _boxes(boxes, result.tracks),
        "world/vehicles": _boxes(transform_boxes(origin_SE3_velo, vehicles.boxes), vehicles),
        "world/velocities": rr.Arrows3D(
            origins=boxes.centers_m,
            vectors=np.column_stack([velocities_m_s, np.zeros(len(boxes))]),
            colors=_colors(result.tracks),
        ),
    }


def camera_entities(result: Result, display_score: float) -> Entities:
    """Return image, maps, pinhole and detections of each camera; nothing without a camera and without detectors.

    Args:
        result: Result of the frame.
        display_score: Score from which a detection is shown.
    """
    main, *further = views_of(result)
    entities = _camera_entities(CAMERA, main, display_score)
    for view in further:
        entities |= _camera_entities(camera_path(view.frame.camera), view, display_score)
    return entities


def camera_path(name: str) -> str:
    """Return the entity of a further camera."""
    return f"world/ego/cameras/{name.strip('/').replace('/', '_')}"


def _camera_entities(camera: str, result: Result, display_score: float) -> Entities:
    image = result.frame.image
    entities: Entities = {}
    if image is not None and result.frame.calibration is not None:
        height, width = image.shape[:2]
        velo_SE3_image, matrix = pinhole_of(result.frame.calibration)
        entities[camera] = [
            rr.Transform3D(translation=velo_SE3_image[:3, 3], mat3x3=velo_SE3_image[:3, :3]),
            rr.Pinhole(image_from_camera=matrix, width=width, height=height),
        ]
        entities[f"{camera}/image"] = _encoded(image[:, :, ::-1])
    for modality, values in result.map_images.items():
        entities[f"{camera}/{modality}"] = _encoded(values)
    for modality, found in result.modality_detections.items():
        entities[f"{camera}/detections/{modality}"] = _rectangles(
            found, display_score, _MODALITY_COLORS[modality]
        )
    if result.vehicles is not None:
        fused = result.vehicles.fused.detections
        entities[f"{camera}/detections/fused"] = _rectangles(fused, display_score, palette.TEXT)
    return entities


def series_entities(result: Result) -> Entities:
    """Return the numbers of a frame that are drawn over time."""
    frame, states = result.frame, result.obstacles.point_states
    counts = np.bincount(states, minlength=len(PointState))
    vehicles = 0 if result.vehicles is None else len(result.vehicles.fused.detections)
    values = {
        **{f"timings/{stage}": 1e3 * seconds for stage, seconds in result.timings_s.items()},
        "timings/end to end": 1e3 * result.duration_s,
        **{f"counts/points/{state.name.lower()}": counts[state] for state in PointState},
        "counts/tracks": len(result.tracks),
        "counts/detections": vehicles,
        "health/skipped stages": len(result.skipped),
        "health/invalid points": frame.invalid_points,
        **{f"health/{part}": int(result.health.level_of(part)) for part in SENSOR_PARTS},
    }
    return {path: rr.Scalars(float(value)) for path, value in values.items() if np.isfinite(value)}


def pinhole_of(calibration: Calibration) -> tuple[Float64, Float64]:
    """Return the (4, 4) pose of the camera in the LiDAR frame and its (3, 3) matrix.

    The last column of the projection moves the camera, as KITTI's baselines do.
    """
    matrix = calibration.image_P_cam[:, :3]
    shift_m = np.linalg.solve(matrix, calibration.image_P_cam[:, 3])
    image_SE3_velo = se3.from_rotation_translation(np.eye(3), shift_m) @ calibration.cam_SE3_velo
    return se3.inverse(image_SE3_velo), matrix


def _boxes(boxes: Boxes3D, tracks: Tracks) -> list[Any]:
    """Return boxes with the labels of their tracks, and the values of a label as numbers."""
    half_yaw_rad = boxes.yaw_rad / 2
    zeros = np.zeros(len(boxes))
    speeds_m_s = np.linalg.norm(tracks.velocities_m_s, axis=1)
    parts: list[Any] = [
        rr.Boxes3D(
            centers=boxes.centers_m,
            sizes=boxes.size_m,
            quaternions=np.column_stack([zeros, zeros, np.sin(half_yaw_rad), np.cos(half_yaw_rad)]),
            labels=[
                _label(*row)
                for row in zip(
                    tracks.ids.tolist(), tracks.types.tolist(), speeds_m_s.tolist(), strict=True
                )
            ],
            colors=_colors(tracks),
        )
    ]
    if len(tracks):  # Rerun has no type for values without rows
        values = {"track_id": tracks.ids, "speed_m_s": speeds_m_s, "score": tracks.scores}
        parts.append(rr.AnyValues(**values, is_observed=tracks.is_observed))
    return parts


def _label(track_id: int, kind: str, speed_m_s: float) -> str:
    words = [f"#{track_id}" if track_id >= 0 else "", kind]
    if np.isfinite(speed_m_s):
        words.append(f"{speed_m_s:.1f} m/s")
    return " ".join(filter(None, words))


def _rectangles(detections: Detections, display_score: float, color: Color) -> Any:  # noqa: ANN401 - an archetype
    shown = detections[detections.scores >= display_score]
    labels = [
        f"{kind} {score:.2f}"
        for kind, score in zip(shown.types.tolist(), shown.scores.tolist(), strict=True)
    ]
    return rr.Boxes2D(
        array=shown.boxes_px, array_format=rr.Box2DFormat.XYXY, labels=labels, colors=color
    )


def _colors(tracks: Tracks) -> UInt8:
    colors = [palette.track_color(track) for track in tracks.ids.tolist()]
    return np.array(colors, np.uint8).reshape(-1, 3)


def _encoded(image: UInt8) -> Any:  # noqa: ANN401 - an archetype
    """Return a grey or BGR image as JPEG."""
    _, encoded = cv2.imencode(".jpg", image, (cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY))
    return rr.EncodedImage(contents=encoded.tobytes(), media_type="image/jpeg")
