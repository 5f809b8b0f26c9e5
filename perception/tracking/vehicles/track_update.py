"""Update of vehicle tracks by the detections that continue them, in the image and on the ground."""

from dataclasses import dataclass, replace
from typing import Annotated, Self

import numpy as np

from perception.geometry import se3
from perception.geometry.boxes import transform_boxes
from perception.geometry.camera import project
from perception.geometry.se3 import wrap
from perception.tracking import motion_model
from perception.tracking.vehicles.config import VehicleTrackerConfig
from perception.tracking.vehicles.vehicle_table import VehicleTable
from perception.tracking.visible_sides import from_world, to_world
from perception.types import ArrayTable, Bool, Boxes3D, Detections, Float64, Vehicles

_NEAREST_M = 0.5


@dataclass(frozen=True)
class FrameGeometry:
    """Time, pose and projection of one frame.

    Attributes:
        stamp_s: Time of the scan.
        world_SE3_velo: (4, 4) pose of the LiDAR.
        image_P_velo: (3, 4) projection from the LiDAR frame to pixels.
    """

    stamp_s: float
    world_SE3_velo: Float64
    image_P_velo: Float64

    def anchors_px(self, tracks: VehicleTable) -> Float64:
        """Return (T, 3) column, row and depth of the middle of each 3D box; NaN behind the camera."""
        middles = np.column_stack(
            [tracks.mean[:, :2], tracks.low_world_m + tracks.sizes_m[:, 2] / 2]
        )
        image_P_world = self.image_P_velo @ se3.inverse(self.world_SE3_velo)
        pixels, depths_m = project(image_P_world, middles)
        return np.column_stack([pixels, np.where(depths_m > _NEAREST_M, depths_m, np.nan)])


@dataclass(frozen=True)
class VehicleObservations(ArrayTable):
    """D detections in the world.

    Attributes:
        detections: (D) detections in the image.
        boxes_world: (D) boxes in the world; rows of NaN where they are not located.
        noise: (D, 2, 2) covariances of the positions.
    """

    detections: Detections
    boxes_world: Boxes3D
    noise: Annotated[Float64, 2, 2]

    @classmethod
    def of(cls, vehicles: Vehicles, frame: FrameGeometry, config: VehicleTrackerConfig) -> Self:
        """Transform vehicles to the world."""
        points = np.maximum(vehicles.point_counts, 1)
        away_m = np.nan_to_num(np.linalg.norm(vehicles.boxes.bottom_m, axis=1))
        variances = (
            config.position_noise_m**2
            + (config.position_noise_per_m * away_m) ** 2
            + config.sparse_noise_m**2 / points
        )
        return cls(
            vehicles.fused.detections,
            transform_boxes(frame.world_SE3_velo, vehicles.boxes),
            variances[:, None, None] * np.eye(2),
        )

    @property
    def is_located(self) -> Bool:
        """(D,) whether the vehicle is located in the scan."""
        return np.asarray(np.isfinite(self.boxes_world.bottom_m[:, 0]))


def predict(tracks: VehicleTable, elapsed_s: float, config: VehicleTrackerConfig) -> VehicleTable:
    """Predict the states on the ground."""
    states = motion_model.predict(tracks.states, elapsed_s, config.motion)
    return replace(tracks, mean=states.mean, covariance=states.covariance)


def expected_boxes_px(tracks: VehicleTable, frame: FrameGeometry) -> Float64:
    """Return (T, 4) the predicted box of each track in the image; NaN behind the camera.

    A 2D box moves and grows as its 3D box does; that of a track without a 3D box as it did before.
    """
    now_px = frame.anchors_px(tracks)
    scale = tracks.anchors_px[:, 2:] / now_px[:, 2:]
    corners = tracks.boxes_px.reshape(-1, 2, 2) - tracks.anchors_px[:, None, :2]
    on_ground = (now_px[:, None, :2] + scale[:, None] * corners).reshape(-1, 4)
    unseen_s = (frame.stamp_s - tracks.last_seen_s)[:, None]
    in_image = tracks.boxes_px + unseen_s * tracks.speeds_px_s
    return np.where(tracks.is_located[:, None], on_ground, in_image)


def init_tracks(
    observations: VehicleObservations, frame: FrameGeometry, config: VehicleTrackerConfig
) -> VehicleTable:
    """Return the new tracks of D detections."""
    tracks = VehicleTable.init_in_image(observations.detections, frame.stamp_s)
    return _seen_on_ground(tracks, observations, frame, config)


def update_tracks(
    tracks: VehicleTable,
    observations: VehicleObservations,
    frame: FrameGeometry,
    config: VehicleTrackerConfig,
) -> VehicleTable:
    """Correct each of T tracks by the detection that continues it."""
    elapsed_s = np.maximum(frame.stamp_s - tracks.last_seen_s, 1e-3)[:, None]
    detections = observations.detections
    speeds_px_s = (detections.boxes_px - tracks.boxes_px) / elapsed_s
    gain = config.image_speed_gain
    tracks = replace(
        tracks,
        scores=detections.scores,
        score_sum=tracks.score_sum + detections.scores,
        last_seen_s=np.full(len(tracks), frame.stamp_s),
        boxes_px=detections.boxes_px,
        speeds_px_s=tracks.speeds_px_s + gain * (speeds_px_s - tracks.speeds_px_s),
    )
    return _seen_on_ground(tracks, observations, frame, config)


def _seen_on_ground(
    tracks: VehicleTable,
    observations: VehicleObservations,
    frame: FrameGeometry,
    config: VehicleTrackerConfig,
) -> VehicleTable:
    """Correct the tracks located near their prediction, and relocate those located elsewhere for some time."""
    distances = np.diagonal(position_distances(tracks, observations))
    is_expected = tracks.is_located & (distances <= config.motion.gate)
    is_lost = frame.stamp_s - tracks.last_located_s > config.relocate_after_s
    relocated = np.flatnonzero(
        observations.is_located & ~is_expected & (is_lost | ~tracks.is_located)
    )
    if len(relocated):
        tracks = tracks.replaced(
            relocated, _placed(tracks[relocated], observations[relocated], config)
        )
    rows = np.flatnonzero(observations.is_located & is_expected)
    if len(rows):
        tracks = tracks.replaced(rows, _corrected(tracks[rows], observations[rows], frame, config))
    both = np.concatenate([relocated, rows])
    last_located_s = tracks.last_located_s.copy()
    last_located_s[both] = frame.stamp_s
    tracks = replace(tracks, last_located_s=last_located_s)
    return replace(tracks, anchors_px=np.nan_to_num(frame.anchors_px(tracks), nan=_NEAREST_M))


def position_distances(tracks: VehicleTable, observations: VehicleObservations) -> Float64:
    """Return (T, D) squared Mahalanobis distances on the ground; NaN where either is not located."""
    centers_m = np.broadcast_to(
        observations.boxes_world.bottom_m[:, :2], (len(tracks), len(observations), 2)
    )
    # A track that was never located has no covariance.
    noise = np.broadcast_to(observations.noise, (len(tracks), len(observations), 2, 2))
    distances = motion_model.squared_distances(tracks.states, centers_m, noise)
    return np.where(tracks.is_located[:, None] & observations.is_located, distances, np.nan)


def _placed(
    tracks: VehicleTable, observations: VehicleObservations, config: VehicleTrackerConfig
) -> VehicleTable:
    boxes = observations.boxes_world
    states = motion_model.init(
        boxes.bottom_m[:, :2], observations.noise, boxes.size_m[:, :2], config.motion
    )
    return replace(
        tracks,
        is_located=np.ones(len(tracks), bool),
        mean=states.mean,
        covariance=states.covariance,
        axis=_doubled(boxes.yaw_rad),
        yaw_rad=np.where(
            tracks.is_located, _nearer_end(boxes.yaw_rad, tracks.yaw_rad), boxes.yaw_rad
        ),
        sizes_m=boxes.size_m,
        size_samples=np.ones(len(tracks), np.int64),
        low_world_m=boxes.bottom_m[:, 2],
    )


def _corrected(
    tracks: VehicleTable,
    observations: VehicleObservations,
    frame: FrameGeometry,
    config: VehicleTrackerConfig,
) -> VehicleTable:
    boxes = observations.boxes_world
    size_samples = np.minimum(tracks.size_samples + 1, config.max_size_samples)
    share = 1.0 / size_samples
    sizes_m = tracks.sizes_m + share[:, None] * (boxes.size_m - tracks.sizes_m)
    axis = config.heading_memory * tracks.axis + _doubled(boxes.yaw_rad)
    yaw_rad = _nearer_end(np.arctan2(axis[:, 1], axis[:, 0]) / 2, tracks.yaw_rad)
    shift_m = _hidden_shift_m(boxes, sizes_m, frame.world_SE3_velo[:2, 3])
    states = motion_model.correct(
        tracks.states, boxes.bottom_m[:, :2] + shift_m, observations.noise
    )
    tracks = replace(
        tracks,
        mean=states.mean,
        covariance=states.covariance,
        axis=axis,
        yaw_rad=yaw_rad,
        sizes_m=sizes_m,
        size_samples=size_samples,
        low_world_m=tracks.low_world_m + share * (boxes.bottom_m[:, 2] - tracks.low_world_m),
    )
    return _turned_to_course(tracks, config)


def _turned_to_course(tracks: VehicleTable, config: VehicleTrackerConfig) -> VehicleTable:
    """Choose front and rear by well-known velocities and, once they are fast, correct the heading by the course.

    A vehicle does not turn round within a scan: most of the latest velocities determine its front, and a slow one
    keeps it.
    """
    course_rad = np.arctan2(tracks.mean[:, 3], tracks.mean[:, 2])
    excess_m_s = tracks.speeds_m_s - 2 * tracks.speed_deviations_m_s
    is_fast = (excess_m_s >= config.course_speed_m_s)[:, None]
    axis = tracks.axis + np.where(is_fast, _doubled(course_rad), 0.0)
    yaw_rad = np.arctan2(axis[:, 1], axis[:, 0]) / 2
    yaw_rad = _nearer_end(yaw_rad, tracks.yaw_rad)
    is_ahead = np.abs(wrap(course_rad - yaw_rad)) <= np.pi / 2
    vote = np.where(excess_m_s >= config.front_speed_m_s, np.where(is_ahead, 1, -1), 0)
    votes = np.minimum(tracks.front_votes + vote, config.max_front_votes)
    return replace(
        tracks,
        axis=axis,
        yaw_rad=wrap(np.where(votes < 0, yaw_rad + np.pi, yaw_rad)),
        front_votes=np.abs(votes),
    )


def _hidden_shift_m(boxes: Boxes3D, sizes_m: Float64, sensor_m: Float64) -> Float64:
    """Return (T, 2) the shift of the centres of boxes that change size behind their observed sides."""
    away_m = from_world(boxes.bottom_m[:, :2] - sensor_m, boxes.yaw_rad)
    is_outside = np.abs(away_m) > boxes.size_m[:, :2] / 2
    growth_m = (sizes_m - boxes.size_m)[:, :2] / 2
    return to_world(np.sign(away_m) * is_outside * growth_m, boxes.yaw_rad)


def _doubled(yaw_rad: Float64) -> Float64:
    """Return (T, 2) cosine and sine of twice each angle: the same for both ends of a vehicle."""
    return np.column_stack([np.cos(2 * yaw_rad), np.sin(2 * yaw_rad)])


def _nearer_end(yaw_rad: Float64, reference_rad: Float64) -> Float64:
    """Return the one of each heading and its opposite that is nearer to another heading."""
    return wrap(reference_rad + wrap(yaw_rad - reference_rad, np.pi))


def is_velocity_known(tracks: VehicleTable, config: VehicleTrackerConfig) -> Bool:
    """Return whether the velocity of each track is certain enough to be reported."""
    limit_m_s = config.max_reported_speed_deviation_m_s
    return np.asarray(tracks.is_located & (tracks.speed_deviations_m_s <= limit_m_s))
