"""Records of the objects of a frame: tracks, detected vehicles, and one tracked object; null where a value is not known."""

from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from data.results.documents import to_serializable
from perception.geometry.boxes import transform_boxes
from perception.geometry.se3 import wrap
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import (
    MODALITIES,
    Boxes3D,
    Float64,
    Int,
    ModalityDetections,
    Result,
    Tracks,
)

Number = float | None

_UNKNOWN_BOX = Boxes3D(np.full((1, 3), np.nan), np.full((1, 3), np.nan), np.full(1, np.nan))


@dataclass(frozen=True)
class FrameLine:
    """Frame of a line.

    Attributes:
        frame: Index of the frame.
        stamp_s: Time of the scan.
    """

    frame: int
    stamp_s: float


@dataclass(frozen=True)
class Place:
    """Place and velocity of a box in one frame of reference.

    Attributes:
        position_m: Centre of the bottom face x, y, z.
        yaw_rad: Heading from -pi to pi.
        velocity_m_s: Velocity over the ground x, y, z.
    """

    position_m: list[Number]
    yaw_rad: Number
    velocity_m_s: list[Number]

    @classmethod
    def of(cls, boxes: Boxes3D, velocities_m_s: Float64) -> list[Self]:
        """Return the place of each box."""
        yaw_rad = numbers(wrap(boxes.yaw_rad), 6)
        columns = numbers(boxes.bottom_m), yaw_rad, numbers(velocities_m_s)
        return [cls(*row) for row in zip(*columns, strict=True)]


@dataclass(frozen=True)
class ObjectRecord:
    """One object in one frame.

    Attributes:
        id: Track id; of a vehicle, null before it is tracked.
        type: Class that a detector or a label gave the object; null where there is none.
        score: Fused score of the last detection, 0 to 1.
        size_m: Length, width and height.
        speed_m_s: Speed over the ground.
        covariance: Covariance of x, y, and the velocity along x and y, in the LiDAR frame; of a velocity null before the
            object is tracked.
        size_std_m: Standard deviations of length, width and height.
        yaw_std_rad: Standard deviation of the heading modulo pi.
        reversal: Probability that the front is the rear.
        velo: Place in the LiDAR frame of the scan.
        world: Place in the world frame of `poses.txt`.
    """

    id: int | None
    type: str | None
    score: Number
    size_m: list[Number]
    speed_m_s: Number
    covariance: list[list[Number]] | None
    # Absent in what earlier versions wrote.
    size_std_m: list[Number] | None = field(default=None, kw_only=True)
    yaw_std_rad: Number = field(default=None, kw_only=True)
    reversal: Number = field(default=None, kw_only=True)
    velo: Place
    world: Place


@dataclass(frozen=True)
class TrackRecord(ObjectRecord):
    """One track in one frame.

    Attributes:
        is_observed: Whether the track is measured in this scan, not predicted.
    """

    is_observed: bool


@dataclass(frozen=True)
class FrameTracks(FrameLine):
    """One line of `tracks.jsonl`.

    Attributes:
        tracks: All tracks of the frame.
    """

    tracks: list[TrackRecord]

    @classmethod
    def of(cls, result: Result) -> Self:
        """Return the tracks of one result."""
        rows = zip(_fields(result, result.tracks), result.tracks.is_observed, strict=True)
        tracks = [TrackRecord(**fields, is_observed=bool(seen)) for fields, seen in rows]
        return cls(*frame_of(result), tracks)


@dataclass(frozen=True)
class VehicleRecord(ObjectRecord):
    """One detected vehicle in one frame.

    Attributes:
        existence: Probability that the object exists, accumulated over the detections of its track, 0 to 1.
        camera: Name of the camera that the rectangle and the scores are of, the one that shows the vehicle best;
            empty where none does.
        box_px: Rectangle x1 y1 x2 y2 in its image; null without a camera.
        dominant_modality: Modality of the detector with the largest weight in the fused score; bev where it is seen
            from above alone.
        scores: Score of each detector by modality; null where it has no detection.
        points: Number of LiDAR points on the vehicle.
        distance_m: Distance from the LiDAR to the nearest return.
    """

    existence: Number
    camera: str = field(default="", kw_only=True)  # absent in what earlier versions wrote
    box_px: list[float] | None
    dominant_modality: str
    scores: dict[str, Number]
    points: int
    distance_m: Number


@dataclass(frozen=True)
class FrameVehicles(FrameLine):
    """One line of `vehicles.jsonl`.

    Attributes:
        vehicles: Detected vehicles of the frame.
    """

    vehicles: list[VehicleRecord]

    @classmethod
    def of(cls, result: Result, min_score: float = 0.0) -> Self | None:
        """Return the vehicles of one result from a score on; None where no detector ran."""
        vehicles = result.vehicles
        if vehicles is None:
            return None
        rows = np.flatnonzero(vehicles.fused.detections.scores >= min_score)
        fused, has_camera = vehicles.fused[rows], result.frame.calibration is not None
        cameras = vehicles.cameras[rows].tolist()
        bev_scores = to_serializable(np.round(vehicles.bev_scores[rows], 4))
        columns = {
            "existence": numbers(fused.existence),
            "camera": [result.frame.views[one].camera if one >= 0 else "" for one in cameras],
            "box_px": [
                numbers(box_px) if has_camera and np.isfinite(box_px).all() else None
                for box_px in fused.detections.boxes_px
            ],
            "dominant_modality": vehicles.dominant_modalities[rows].tolist(),
            "scores": [
                {**_scores(result.detections_in(camera), sources), "bev": bev_score}
                for camera, sources, bev_score in zip(
                    cameras, fused.source_indices, bev_scores, strict=True
                )
            ],
            "points": vehicles.point_counts[rows].tolist(),
            "distance_m": numbers(vehicles.distances_m[rows]),
        }
        values = zip(_fields(result, vehicles.as_tracks(rows)), *columns.values(), strict=True)
        records = [
            VehicleRecord(**fields, **dict(zip(columns, row, strict=True)))
            for fields, *row in values
        ]
        return cls(*frame_of(result), records)


@dataclass(frozen=True)
class TrajectoryRecord(ObjectRecord, FrameLine):
    """One line of `trajectory.jsonl`; of a tracker in the image alone, only the rectangle is known.

    Attributes:
        status: `seen`, `predicted` or `lost`.
        box_px: Rectangle x1 y1 x2 y2 in the image; null where the object is not in it.
        next_position_velo_m: Predicted centre of the bottom face one scan later x, y, z, in the LiDAR frame of
            this scan; null of a lost object.
        next_position_world_m: The same in the world frame.
        hull_px: Columns and rows of the corners of the convex hull of the object's pixels, which may lie beyond the
            image; null of trackers without a colour model, and where the object is not measured in the image.
        ring_px: The same of the outline of the surrounding ring, the background of the colour model.
    """

    status: str
    box_px: list[float] | None
    next_position_velo_m: list[float] | None
    next_position_world_m: list[float] | None
    hull_px: list[list[float]] | None
    ring_px: list[list[float]] | None

    @classmethod
    def of(cls, result: Result, tracked: TrackedObject, object_id: int, kind: str | None) -> Self:
        """Return the object in one frame.

        Args:
            result: Result of the frame.
            tracked: Object in the frame.
            object_id: Track id of the object.
            kind: KITTI type of the object, or None where it is not known.
        """
        (fields,) = _fields(result, as_tracks(tracked, object_id))
        fields["type"] = kind
        next_velo, next_world = tracked.next_bottom_velo, None
        if next_velo is not None:
            next_world = (result.world_SE3_velo @ np.append(next_velo, 1.0))[:3]
        region = tracked.region
        return cls(
            *frame_of(result),
            **fields,
            status=str(tracked.status),
            box_px=_known(tracked.box_px, 2),
            next_position_velo_m=_known(next_velo),
            next_position_world_m=_known(next_world),
            hull_px=_known(None if region is None else region.hull_px, 2),
            ring_px=_known(None if region is None else region.outer_px, 2),
        )


def as_tracks(tracked: TrackedObject, object_id: int) -> Tracks:
    """Return one tracked object as a track; NaN of a tracker in the image alone."""
    velocity_m_s, box_velo = tracked.velocity_m_s, tracked.box_velo
    if box_velo is None:
        velocity_m_s, box_velo = np.full(2, np.nan), _UNKNOWN_BOX
    is_seen = np.array([tracked.status is TrackStatus.SEEN])
    return Tracks.unclassified(np.array([object_id]), box_velo, velocity_m_s[None], is_seen)


def frame_of(result: Result) -> tuple[int, float]:
    """Return the values of a `FrameLine`."""
    return result.frame.index, round(result.frame.stamp_s, 6)


def numbers(values: Float64, digits: int = 4) -> Any:  # noqa: ANN401 - nested as the array
    """Return rounded numbers as nested lists; None where a number is not known."""
    rounded = np.round(values, digits) + 0.0  # without the sign of -0.0
    return rounded.tolist() if np.isfinite(rounded).all() else to_serializable(rounded)


def _known(values: Float64 | None, digits: int = 4) -> Any:  # noqa: ANN401 - nested as the array
    return None if values is None else numbers(values, digits)


def _fields(result: Result, tracks: Tracks) -> list[dict[str, Any]]:
    """Return the fields of an `ObjectRecord` of each track; NaN, -1 and no text are not known."""
    # No velocity upwards; not known where the others are not.
    velocities_velo = np.column_stack([tracks.velocities_m_s, 0 * tracks.velocities_m_s[:, 0]])
    velocities_world = velocities_velo @ result.world_SE3_velo[:3, :3].T
    boxes_world = transform_boxes(result.world_SE3_velo, tracks.boxes)
    columns = {
        "id": [track if track >= 0 else None for track in tracks.ids.tolist()],
        "type": [name or None for name in tracks.types.tolist()],
        "score": numbers(tracks.scores),
        "size_m": numbers(tracks.boxes.size_m),
        "speed_m_s": numbers(np.linalg.norm(tracks.velocities_m_s, axis=1)),
        "covariance": [
            numbers(one, 6) if np.isfinite(one[:2, :2]).all() else None
            for one in tracks.covariances
        ],
        "size_std_m": numbers(tracks.box_deviations.size_m),
        "yaw_std_rad": numbers(tracks.box_deviations.yaw_rad),
        "reversal": numbers(tracks.box_deviations.reversal),
        "velo": Place.of(tracks.boxes, velocities_velo),
        "world": Place.of(boxes_world, velocities_world),
    }
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _scores(found: ModalityDetections, sources: Int) -> dict[str, Number]:
    """Return the score of each detector by the rows of its detections."""
    return {
        modality: numbers(found[modality].scores[row]) if row >= 0 else None
        for modality, row in zip(MODALITIES, sources, strict=True)
    }
