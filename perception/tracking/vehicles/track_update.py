"""Update of vehicle tracks by the detections that continue them, in the image and on the ground."""

from dataclasses import replace

import numpy as np

from perception.geometry.camera import box_outlines_px
from perception.geometry.se3 import wrap
from perception.tracking import motion_model
from perception.tracking.kalman import Gaussians
from perception.tracking.vehicles.class_sizes import SizePriors
from perception.tracking.vehicles.evidence import added, log_odds, remembered
from perception.tracking.vehicles.motion_modes import MotionModes
from perception.tracking.vehicles.observations import (
    ASSUMED_HEIGHT_M,
    NEAREST_M,
    FrameGeometry,
    VehicleObservations,
)
from perception.tracking.vehicles.vehicle_table import VehicleTable
from perception.tracking.visible_sides import from_world, shift_behind
from perception.types import Bool, Float64, Int

_MAX_WALKING_SPEED_M_S = 3.0  # above which a person rides; detectors see the rider of a cycle, too
_MAX_RIDING_VOTES = 10  # detections above that speed, less those below, that settle it
# Minimum log-odds of a detection that continues the track of a person: detectors hardly see people in crowds, and a weak one
# where one is expected speaks for it. A vehicle that is weakly seen has no box that fits.
_MIN_EXPECTED_ODDS = 0.3
_BOX_GAIN = 0.5  # gain of the correction of a box in the image
# Time located elsewhere than predicted, by the frame before, after which a track moves there.
RELOCATE_AFTER_S = 0.25
# Time constants of the memories of an axis and of a size, and the deviation below which one observation weighs no more.
_AXIS_MEMORY_S, _SIZE_MEMORY_S, _SURE_SIZE_M = 0.5, 4.0, 0.1
_CLASS_MEMORY_S = 4.0  # time constant of the memory of what tells the class
_FRONT_MEMORY_S = 1.0  # the same of what tells the front: the shape tells it best from some sides
_SIDEWAYS_M_S = 1.0  # standard deviation of the velocity of a vehicle across its axis
_SURE_AXIS_RAD = 0.05  # standard deviation of an observed axis, of which half the weight is left
_COURSE_SPEED_M_S = 2.0  # minimum speed at which the course corrects the heading
_FRONT_SPEED_M_S = 1.0  # minimum speed at which the course distinguishes front and rear
_FRONT_SHARE = 0.25  # of the length, driven in a direction that is then the front by odds of e
SMALL_LENGTH_M = 2.2  # of people on foot and on two wheels, whose outline hardly shows a heading
_SMALL_COURSE_SPEED_M_S = 0.6  # both minimum speeds of these
_SMALL_COURSE_WEIGHT = 5.0  # number of observations of the outline that their course outweighs
_MAX_TRAVELLED = 6.0  # log-odds by motion that the opposite one has to outweigh
_MAX_SPEED_DEVIATION_M_S = 2.0  # maximum standard deviation of a reported velocity


def expected_boxes_px(tracks: VehicleTable, frame: FrameGeometry, cameras: Int) -> Float64:
    """Return (T, 4) the predicted box of each track within the image of a camera, NaN behind it.

    The box in the image moves and grows as the 3D box; one that was last detected in the image of another camera, which
    may have shown a part of it, is the outline of the 3D box.

    Args:
        tracks: T tracks.
        frame: Geometry of the frame in the camera of each.
        cameras: (T,) numbers of these cameras.
    """
    now_px = frame.project(tracks.middles_world)
    scale = tracks.anchors_px[:, 2:] / now_px[:, 2:]
    corners = tracks.boxes_px.reshape(-1, 2, 2) - tracks.anchors_px[:, None, :2]
    boxes_px = frame.clip((now_px[:, None, :2] + scale[:, None] * corners).reshape(-1, 4))
    is_other = tracks.cameras != cameras
    if not is_other.any():
        return boxes_px
    return np.where(is_other[:, None], _outlines_px(tracks, now_px, frame), boxes_px)


def _outlines_px(tracks: VehicleTable, now_px: Float64, frame: FrameGeometry) -> Float64:
    """Return (T, 4) the outlines of 3D boxes, and boxes of the assumed height where the returns have given no 3D box."""
    sizes_px = tracks.boxes_px[:, 2:] - tracks.boxes_px[:, :2]
    height_px = frame.focal_px[..., None] * ASSUMED_HEIGHT_M / now_px[:, 2:]
    half_px = height_px / 2 * sizes_px / np.maximum(sizes_px[:, 1:], 1.0)
    assumed_px = frame.clip(np.hstack([now_px[:, :2] - half_px, now_px[:, :2] + half_px]))
    boxes_velo = tracks.boxes_velo(tracks.sizes_m, frame.world_SE3_velo)
    outlines_px = box_outlines_px(frame.image_P_velo, boxes_velo, frame.image_size_px)
    return np.where(tracks.is_located[:, None], outlines_px, assumed_px)


def init_tracks(observations: VehicleObservations, frame: FrameGeometry) -> VehicleTable:
    """Return the new tracks of D detections."""
    count, boxes = len(observations), observations.boxes_world
    states = _init_states(observations)
    tracks = VehicleTable(
        mean=states.mean,
        covariance=states.covariance,
        yaw_rad=boxes.yaw_rad,
        low_world_m=boxes.bottom_m[:, 2],
        modes=MotionModes.init(states),
        ids=np.full(count, -1),
        class_evidence=observations.class_likelihoods,
        scores=observations.detections.scores,
        evidence=log_odds(observations.existence),
        detections=np.ones(count, np.int64),
        last_seen_s=np.full(count, frame.stamp_s),
        boxes_px=observations.detections.boxes_px,
        cameras=observations.cameras,
        anchors_px=np.zeros((count, 3)),
        is_located=observations.is_located,
        last_located_s=np.full(count, frame.stamp_s),
        travelled=np.zeros(count),
        riding_votes=np.zeros(count, np.int64),
        axis=_axes(observations),
        front_odds=_front_odds(observations),
        sizes_m=boxes.size_m,
        size_weights=_size_weights(observations),
    )
    return _anchored(tracks, frame)


def update_tracks(
    tracks: VehicleTable,
    observations: VehicleObservations,
    expected_px: Float64,
    pose_shares: Float64,
    frame: FrameGeometry,
    elapsed_s: float,
) -> VehicleTable:
    """Correct each of T tracks by the detection that continues it.

    Where the pose is uncertain, a box that is found beside the expected one tells little of the track: its anchor moves along.

    Args:
        tracks: T predicted tracks.
        observations: T detections.
        expected_px: (T, 4) predicted boxes in the image.
        pose_shares: (T,) shares of the variances of their columns that the pose gives.
        frame: Geometry of the frame in the camera of each detection.
        elapsed_s: Time since the frame before.
    """
    found_px = observations.detections.boxes_px
    gains = np.full((len(tracks), 4), _BOX_GAIN)
    gains[:, ::2] /= 1 - _BOX_GAIN * pose_shares[:, None]
    change_px = gains * (found_px - expected_px)
    smoothed_px = expected_px + change_px
    has_sides = SizePriors.of(observations.detections.types).has_sides
    odds = log_odds(observations.existence)
    odds = np.where(has_sides, odds, np.maximum(odds, _MIN_EXPECTED_ODDS))
    evidence = tracks.evidence + added(odds, elapsed_s)
    tracks = replace(
        tracks,
        class_evidence=remembered(elapsed_s, _CLASS_MEMORY_S) * tracks.class_evidence
        + added(observations.class_likelihoods, elapsed_s, _CLASS_MEMORY_S),
        scores=observations.detections.scores,
        evidence=evidence,
        detections=tracks.detections + 1,
        last_seen_s=np.full(len(tracks), frame.stamp_s),
        boxes_px=np.where(np.isfinite(smoothed_px), smoothed_px, found_px),
        cameras=observations.cameras,
    )
    tracks = _anchored(_seen_on_ground(tracks, observations, frame, elapsed_s), frame)
    along_px = np.nan_to_num(pose_shares * change_px[:, ::2].mean(axis=1))
    return replace(tracks, anchors_px=tracks.anchors_px + along_px[:, None] * [1, 0, 0])


def _init_states(observations: VehicleObservations) -> Gaussians:
    """Return the states after one observation; vehicles move along their axes as far as these are known."""
    boxes = observations.boxes_world
    states = motion_model.init(boxes.bottom_m[:, :2], observations.noise, boxes.size_m[:, :2])
    is_vehicle = boxes.size_m[:, 0] >= SMALL_LENGTH_M
    turn_rad = np.where(is_vehicle, np.nan_to_num(observations.axis_rad, nan=np.pi), np.pi)
    along = states.covariance[:, 2, 2]
    across = np.minimum(
        along * np.sin(np.minimum(turn_rad, np.pi / 2)) ** 2 + _SIDEWAYS_M_S**2, along
    )
    covariance = states.covariance.copy()
    covariance[:, 2:, 2:] = motion_model.turned_variances(
        np.column_stack([along, across]), boxes.yaw_rad
    )
    return Gaussians(states.mean, covariance)


def _anchored(tracks: VehicleTable, frame: FrameGeometry) -> VehicleTable:
    anchors_px = np.nan_to_num(frame.project(tracks.middles_world), nan=NEAREST_M)
    return replace(tracks, anchors_px=anchors_px)


def _seen_on_ground(
    tracks: VehicleTable,
    observations: VehicleObservations,
    frame: FrameGeometry,
    elapsed_s: float,
) -> VehicleTable:
    """Correct the tracks located near their prediction, and relocate those located elsewhere for some time.

    A vehicle is near where either of its motions expects it: their mean is far from what starts fast. The returns of a person
    may be those of another object, and are no motion.
    """
    centers_m, noise = observations.boxes_world.bottom_m[:, :2], observations.noise
    of_mean = motion_model.squared_distances(tracks, centers_m[:, None], noise[:, None])[:, 0]
    is_small = tracks.sizes_m[:, 0] < SMALL_LENGTH_M
    distances = np.where(is_small, of_mean, tracks.modes.squared_distances(centers_m, noise))
    both = tracks.is_located & observations.is_located
    is_expected = both & (distances <= motion_model.GATE)
    is_lost = frame.stamp_s - elapsed_s - tracks.last_located_s > RELOCATE_AFTER_S
    relocated = np.flatnonzero(
        observations.is_located & ~is_expected & (is_lost | ~tracks.is_located)
    )
    if len(relocated):
        tracks = tracks.replaced(relocated, _placed(tracks[relocated], observations[relocated]))
    rows = np.flatnonzero(observations.is_located & is_expected)
    if len(rows):
        tracks = tracks.replaced(rows, _corrected(tracks[rows], observations[rows], frame))
    assumed = np.flatnonzero(~observations.is_located & ~tracks.is_located)
    if len(assumed):
        tracks = tracks.replaced(assumed, _assumed(tracks[assumed], observations[assumed]))
    last_located_s = tracks.last_located_s.copy()
    last_located_s[np.concatenate([relocated, rows])] = frame.stamp_s
    return replace(tracks, last_located_s=last_located_s)


def _assumed(tracks: VehicleTable, observations: VehicleObservations) -> VehicleTable:
    """Correct tracks that were never located by assumed positions."""
    bottom_m = observations.boxes_world.bottom_m
    tracks = tracks.moved(tracks.modes.corrected(bottom_m[:, :2], observations.noise))
    return replace(tracks, low_world_m=bottom_m[:, 2])


def position_distances(tracks: VehicleTable, observations: VehicleObservations) -> Float64:
    """Return (T, D) squared Mahalanobis distances on the ground; NaN where either is not located."""
    centers_m = np.broadcast_to(
        observations.boxes_world.bottom_m[:, :2], (len(tracks), len(observations), 2)
    )
    noise = np.broadcast_to(observations.noise, (len(tracks), len(observations), 2, 2))
    distances = motion_model.squared_distances(tracks, centers_m, noise)
    return np.where(tracks.is_located[:, None] & observations.is_located, distances, np.nan)


def _placed(tracks: VehicleTable, observations: VehicleObservations) -> VehicleTable:
    boxes = observations.boxes_world
    states = _init_states(observations)
    return replace(
        tracks,
        is_located=np.ones(len(tracks), bool),
        mean=states.mean,
        covariance=states.covariance,
        modes=MotionModes.init(states),
        axis=_axes(observations),
        yaw_rad=np.where(
            tracks.is_located, _nearer_end(boxes.yaw_rad, tracks.yaw_rad), boxes.yaw_rad
        ),
        sizes_m=boxes.size_m,
        size_weights=_size_weights(observations),
        low_world_m=boxes.bottom_m[:, 2],
        # It may be another object.
        travelled=np.zeros(len(tracks)),
        front_odds=_front_odds(observations),
    )


def _corrected(
    tracks: VehicleTable, observations: VehicleObservations, frame: FrameGeometry
) -> VehicleTable:
    boxes = observations.boxes_world
    elapsed_s = frame.stamp_s - tracks.last_located_s
    size_weights = tracks.size_weights * np.exp(-elapsed_s / _SIZE_MEMORY_S)[:, None]
    size_weights += (found := _size_weights(observations))
    shares = found / size_weights
    sizes_m = tracks.sizes_m + shares * (boxes.size_m - tracks.sizes_m)
    axis = tracks.axis * np.exp(-elapsed_s / _AXIS_MEMORY_S)[:, None] + _axes(observations)
    yaw_rad = _nearer_end(np.arctan2(axis[:, 1], axis[:, 0]) / 2, tracks.yaw_rad)
    away_m = from_world(boxes.bottom_m[:, :2] - frame.world_SE3_velo[:2, 3], boxes.yaw_rad)
    shift_m = shift_behind(away_m, boxes.size_m[:, :2], sizes_m[:, :2], boxes.yaw_rad)
    # The sides that were seen stay where they are.
    grown_m = shift_behind(away_m, tracks.sizes_m[:, :2], sizes_m[:, :2], boxes.yaw_rad)
    modes = tracks.modes.shifted(grown_m)
    modes = modes.corrected(boxes.bottom_m[:, :2] + shift_m, observations.noise)
    tracks = replace(
        tracks.moved(modes),
        axis=axis,
        yaw_rad=yaw_rad,
        sizes_m=sizes_m,
        size_weights=size_weights,
        low_world_m=tracks.low_world_m + shares[:, 2] * (boxes.bottom_m[:, 2] - tracks.low_world_m),
    )
    tracks = replace(tracks, riding_votes=_riding_votes(tracks))
    return _turned_to_course(tracks, observations, elapsed_s)


def _size_weights(observations: VehicleObservations) -> Float64:
    """Return (D, 3) weights of observed sizes, by their deviations; alike where these are not known."""
    return np.asarray(1 / (np.nan_to_num(observations.size_deviations_m) ** 2 + _SURE_SIZE_M**2))


def _riding_votes(tracks: VehicleTable) -> Int:
    """Return (T,) the votes of the speeds so far, and of the present ones, that a person rides.

    Returns of another object move a walker for some scans; who rode for long may wait.
    """
    deviations_m_s = 2 * tracks.speed_deviations_m_s
    is_fast = tracks.speeds_m_s - deviations_m_s > _MAX_WALKING_SPEED_M_S
    is_slow = tracks.speeds_m_s + deviations_m_s < _MAX_WALKING_SPEED_M_S
    votes = np.maximum(tracks.riding_votes + is_fast - is_slow, 0)
    is_settled = tracks.riding_votes >= _MAX_RIDING_VOTES
    return np.where(is_settled, tracks.riding_votes, votes)


def _turned_to_course(
    tracks: VehicleTable, observations: VehicleObservations, elapsed_s: Float64
) -> VehicleTable:
    """Choose front and rear by log-odds and, once velocities are fast, correct the heading by the course.

    A vehicle does not turn round within a scan: the way that it went lately tells its front, and what stops keeps it. Shape and
    traffic, the mean of what its detections state, tell that of what has not moved: a box that jumps by a part of its length,
    as another of its ends is taken for hidden, has a speed, too.
    """
    course_rad = np.arctan2(tracks.mean[:, 3], tracks.mean[:, 2])
    is_small = tracks.sizes_m[:, 0] < SMALL_LENGTH_M
    # A walker is slower than two deviations of any located velocity.
    deviations = np.where(is_small, 1.0, 2.0)
    excess_m_s = tracks.speeds_m_s - deviations * tracks.speed_deviations_m_s
    is_fast = excess_m_s >= np.where(is_small, _SMALL_COURSE_SPEED_M_S, _COURSE_SPEED_M_S)
    course_deviations_rad = tracks.speed_deviations_m_s / np.maximum(tracks.speeds_m_s, 0.1)
    certainties = np.where(is_small, _SMALL_COURSE_WEIGHT, _axis_weights(course_deviations_rad))
    weights = is_fast * certainties
    axis = tracks.axis + weights[:, None] * _doubled(course_rad)
    yaw_rad = np.arctan2(axis[:, 1], axis[:, 0]) / 2
    yaw_rad = _nearer_end(yaw_rad, tracks.yaw_rad)
    is_moving = excess_m_s >= np.where(is_small, _SMALL_COURSE_SPEED_M_S, _FRONT_SPEED_M_S)
    ahead_m = is_moving * tracks.speeds_m_s * np.cos(course_rad - yaw_rad) * elapsed_s
    lengths_m = np.maximum(tracks.sizes_m[:, 0], observations.boxes_world.size_m[:, 0])
    travelled = tracks.travelled + ahead_m / (_FRONT_SHARE * lengths_m)
    travelled = np.clip(travelled, -_MAX_TRAVELLED, _MAX_TRAVELLED)
    is_stated = np.abs(wrap(observations.boxes_world.yaw_rad - yaw_rad)) <= np.pi / 2
    stated = _front_odds(observations) * np.where(is_stated, 1, -1)
    share = np.maximum(1 / tracks.detections, -np.expm1(-elapsed_s / _FRONT_MEMORY_S))
    front_odds = tracks.front_odds + share * (stated - tracks.front_odds)
    turn = np.where(front_odds + travelled < 0, -1, 1)
    return replace(
        tracks,
        axis=axis,
        yaw_rad=wrap(np.where(turn < 0, yaw_rad + np.pi, yaw_rad)),
        travelled=turn * travelled,
        front_odds=turn * front_odds,
    )


def _front_odds(observations: VehicleObservations) -> Float64:
    """Return (D,) log-odds of the stated fronts; 0 where they are not known."""
    return -log_odds(np.nan_to_num(observations.reversal, nan=0.5))


def _axes(observations: VehicleObservations) -> Float64:
    """Return (D, 2) axes, by their certainty the longer."""
    weights = _axis_weights(np.nan_to_num(observations.axis_rad))
    return weights[:, None] * _doubled(observations.boxes_world.yaw_rad)


def _axis_weights(deviations_rad: Float64) -> Float64:
    """Return the weights of axes with these standard deviations."""
    return np.asarray(_SURE_AXIS_RAD**2 / (_SURE_AXIS_RAD**2 + deviations_rad**2))


def _doubled(yaw_rad: Float64) -> Float64:
    """Return (T, 2) cosine and sine of twice each angle: the same for both ends of a vehicle."""
    return np.column_stack([np.cos(2 * yaw_rad), np.sin(2 * yaw_rad)])


def _nearer_end(yaw_rad: Float64, reference_rad: Float64) -> Float64:
    """Return the one of each heading and its opposite that is nearer to another heading."""
    return wrap(reference_rad + wrap(yaw_rad - reference_rad, np.pi))


def is_velocity_known(tracks: VehicleTable) -> Bool:
    """Return whether the velocity of each track is certain enough to be reported."""
    return np.asarray(tracks.is_located & (tracks.speed_deviations_m_s <= _MAX_SPEED_DEVIATION_M_S))
