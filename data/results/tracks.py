"""Tracks of a run: `tracks.jsonl` for all of them, and KITTI's tracking rows for those in the image.

    tracks.jsonl     one `FrameTracks` a line
    tracks/NAME.txt  result rows of KITTI's tracking benchmark (18 columns); NAME is the drive's name, such as 0000

`trifuse evaluate results` reads the folder `tracks`.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from data.kitti.labels import alphas_rad, boxes_to_cam
from data.kitti.tracking_rows import TrackingRows, format_result_rows
from data.results.records import LineFiles
from perception.geometry.boxes import transform_boxes
from perception.geometry.camera import box_outlines_px
from perception.geometry.se3 import wrap
from perception.types import Boxes3D, Calibration, Detections, Float64, Int, Result, Tracks

# Upper volumes of the author's classes, height x width x length; a larger box is a car.
_PEDESTRIAN_M3 = 1.8
_CYCLIST_M3 = 4.0
# Scores of a track that is measured in the scan, and of one that is predicted.
OBSERVED_SCORE, PREDICTED_SCORE = 1.0, 0.5
# Values of unknown columns: levels and sizes, positions, angles.
_UNKNOWN, _UNKNOWN_POSITION_M, _UNKNOWN_ANGLE_RAD = -1.0, -1000.0, -10.0


@dataclass(frozen=True)
class VeloPlace:
    """Place of a box in the LiDAR frame of the scan.

    Attributes:
        position_m: Centre of the bottom face x, y, z.
        yaw_rad: Heading from -pi to pi.
    """

    position_m: list[float]
    yaw_rad: float


@dataclass(frozen=True)
class WorldPlace:
    """Place and velocity of a box in the world frame of `poses.txt`.

    Attributes:
        position_m: Centre of the bottom face x, y, z.
        yaw_rad: Heading from -pi to pi.
        velocity_m_s: Velocity over the ground x, y, z.
    """

    position_m: list[float]
    yaw_rad: float
    velocity_m_s: list[float]


@dataclass(frozen=True)
class TrackRecord:
    """One track in one frame.

    Attributes:
        id: Track id.
        is_observed: Whether the track is measured in this scan, not predicted.
        size_m: Length, width and height.
        speed_m_s: Speed over the ground.
        velo: Place in the LiDAR frame.
        world: Place in the world frame.
    """

    id: int
    is_observed: bool
    size_m: list[float]
    speed_m_s: float
    velo: VeloPlace
    world: WorldPlace


@dataclass(frozen=True)
class FrameTracks:
    """One line of `tracks.jsonl`.

    Attributes:
        frame: Index of the frame.
        stamp_s: Time of the scan.
        tracks: All tracks of the frame.
    """

    frame: int
    stamp_s: float
    tracks: list[TrackRecord]

    @classmethod
    def of(cls, result: Result) -> Self:
        """Return the tracks of one result."""
        tracks = result.tracks
        boxes_world = transform_boxes(result.world_SE3_velo, tracks.boxes)
        velocities_world = tracks.velocities_m_s @ result.world_SE3_velo[:3, :2].T
        records = [
            TrackRecord(
                id=int(tracks.ids[row]),
                is_observed=bool(tracks.is_observed[row]),
                size_m=_rounded(tracks.boxes.size_m[row]),
                speed_m_s=round(float(np.linalg.norm(tracks.velocities_m_s[row])), 4),
                velo=VeloPlace(
                    _rounded(tracks.boxes.bottom_m[row]), _angle(tracks.boxes.yaw_rad[row])
                ),
                world=WorldPlace(
                    _rounded(boxes_world.bottom_m[row]),
                    _angle(boxes_world.yaw_rad[row]),
                    _rounded(velocities_world[row]),
                ),
            )
            for row in range(len(tracks))
        ]
        return cls(result.frame.index, round(result.frame.stamp_s, 6), records)


def append_tracks(
    files: LineFiles, name: str, calibration: Calibration | None, result: Result
) -> None:
    """Append the tracks of one frame; KITTI's rows only with a camera and the size of its image.

    Args:
        files: Files of the results.
        name: Name of the drive.
        calibration: Camera calibration.
        result: Result of the frame.
    """
    files.append_record("tracks.jsonl", FrameTracks.of(result))
    if calibration is None or calibration.image_size_px is None:
        files.remove(f"tracks/{name}.txt")
        return
    size_px = calibration.image_size_px
    rows = to_tracking_rows(result.frame.index, result.tracks, calibration, size_px)
    files.append(f"tracks/{name}.txt", format_result_rows(rows))


def to_tracking_rows(
    frame: int, tracks: Tracks, calibration: Calibration, image_size_px: tuple[int, int]
) -> TrackingRows:
    """Return a row for each track that is partly in the image.

    Args:
        frame: Index of the frame.
        tracks: Tracks in the LiDAR frame of the scan.
        calibration: Camera calibration.
        image_size_px: Width and height of the image.
    """
    boxes_px = box_outlines_px(calibration.image_P_velo, tracks.boxes, image_size_px)
    is_in_view = np.flatnonzero(np.isfinite(boxes_px).all(axis=1))
    tracks, boxes_px = tracks[is_in_view], boxes_px[is_in_view]
    scores = np.where(tracks.is_observed, OBSERVED_SCORE, PREDICTED_SCORE)
    detections = Detections(boxes_px, scores, types_by_volume(tracks.boxes))
    return kitti_rows(frame, tracks.ids, tracks.boxes, detections, calibration)


def kitti_rows(
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
        alphas_rad=_known(alphas_rad(boxes_velo, columns[:, 6]), _UNKNOWN_ANGLE_RAD),
        boxes_px=detections.boxes_px,
        sizes_hwl_m=_known(columns[:, :3], _UNKNOWN),
        bottoms_cam_m=_known(columns[:, 3:6], _UNKNOWN_POSITION_M),
        headings_rad=_known(columns[:, 6], _UNKNOWN_ANGLE_RAD),
        scores=detections.scores,
    )


def types_by_volume(boxes: Boxes3D) -> np.ndarray:
    """Classify each box as Pedestrian, Cyclist or Car by its volume, as the author's program does."""
    volumes_m3 = boxes.size_m.prod(axis=1)
    return np.select(
        [volumes_m3 <= _PEDESTRIAN_M3, volumes_m3 <= _CYCLIST_M3], ["Pedestrian", "Cyclist"], "Car"
    )


def _known(values: Float64, otherwise: float) -> Float64:
    return np.where(np.isfinite(values), values, otherwise)


def _rounded(numbers: Float64) -> list[float]:
    return [round(float(number), 4) for number in numbers]


def _angle(angle_rad: float) -> float:
    return round(float(wrap(angle_rad)), 6)
