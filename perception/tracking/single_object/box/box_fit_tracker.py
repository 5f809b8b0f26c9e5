"""The default tracker of one object: its box is fitted to the points, scan by scan.

1. The motion model predicts the box along its heading, with its speed and turn rate.
2. The points above the ground there are compared with the object's shape: the sides of its box that face the sensor,
   and the past observations. Points on the background are given less weight.
3. The poses that remain possible correct the motion. With too little support the object is predicted, the search
   widens, and a pose is accepted only if shape, height and motion agree with it.

The LiDAR alone is used. The box keeps its initial size.
"""

import logging
from dataclasses import replace
from functools import cache

import numpy as np

from perception.geometry.boxes import transform_boxes
from perception.sensor import LidarModel
from perception.tracking.single_object.box.box_track import BoxTrack
from perception.tracking.single_object.box.environment import BackgroundModel, LocalGround
from perception.tracking.single_object.box.object_motion import motion_model_for
from perception.tracking.single_object.box.object_shape import ObjectShape
from perception.tracking.single_object.box.observation import ObjectObservation, observation_of
from perception.tracking.single_object.box.pose_search import (
    REACH,
    PoseEstimate,
    Support,
    search,
    squared_distance,
    support_at,
)
from perception.tracking.single_object.config import BoxFitTrackerConfig
from perception.tracking.single_object.tracker import (
    TrackedObject,
    TrackerInput,
    TrackStatus,
    WorldBox,
    not_initialized,
    validate_initial_box,
)
from perception.types import Boxes3D

_CLEARANCE_M = 0.2  # minimum height above the ground of the object's points
_HEADROOM_M = 0.3  # maximum height of the object's points above the top of its box
_CELL_M = 0.1  # edge of the cells that points are averaged over
_SEARCH_MARGIN_M = (3.0, 6.0)  # minimum and maximum margin around the box for points
_BACKGROUND_WEIGHT = 0.1  # weight of a point that lies on the background
_MIN_REWARD = 1.2  # minimum sum of rewards of an observed object; a point counts up to 1
_MIN_CONTRAST = 0.5  # minimum ratio of rewards to penalties of an observed object
_GATE = 11.3  # maximum squared distance of a true pose (99 %, chi-squared, 3 degrees of freedom)
_MIN_SHARE = 0.1  # minimum share of the expected reward of an observed object
_REACQUIRE_SHARE = 0.25  # minimum share of the expected reward of an object that was hidden
_REACQUIRE_TOP_M = 0.25  # by which a hidden object's height may change, besides the beam spacing
_POSE_DRIFT = 0.02  # in metres and radians, of the pose of a static object between two scans

log = logging.getLogger(__name__)


class BoxFitTracker:
    """Tracks one object by fitting its box; a `SingleObjectTracker`."""

    def __init__(self, sensor: LidarModel, config: BoxFitTrackerConfig | None = None) -> None:
        self._sensor = sensor
        self._config = config or BoxFitTrackerConfig()
        self._track: BoxTrack | None = None

    def init(self, tracker_input: TrackerInput, box_velo: Boxes3D) -> TrackedObject:
        """Initialize the tracker with the object's box.

        Raises:
            PerceptionError: The box is not one finite box of positive size.
        """
        validate_initial_box(box_velo)
        log_lidar_only()
        config, box_world = self._config, transform_boxes(tracker_input.world_SE3_velo, box_velo)
        size_m = box_world.size_m[0].astype(np.float64)
        pose = np.append(box_world.bottom_m[0, :2], box_world.yaw_rad[0])
        spread = np.array(
            [config.initial_deviation_m, config.initial_deviation_m, config.initial_deviation_rad]
        )
        self._motion = motion_model_for(size_m)
        self._track = BoxTrack(
            stamp_s=tracker_input.stamp_s,
            last_seen_s=tracker_input.stamp_s,
            state=self._motion.init(pose, spread),
            ground=LocalGround.below_box(float(box_world.bottom_m[0, 2])),
            shape=ObjectShape.of_box(size_m),
            background=BackgroundModel(),
        )
        _, observation = self._observe(tracker_input, self._track)
        support = support_at(self._track.shape, observation, self._track.pose)
        self._track = self._track.seen(observation, support)
        return self._tracked(tracker_input, self._track)

    def update(self, tracker_input: TrackerInput) -> TrackedObject:
        """Track the object into the next frame.

        Raises:
            PerceptionError: The tracker has not been initialized.
        """
        if self._track is None:
            raise not_initialized("tracker of one object")
        # A scan that is given twice is no second measurement.
        if tracker_input.stamp_s > self._track.stamp_s:
            self._track = self._updated(tracker_input, self._track)
        return self._tracked(tracker_input, self._track)

    def _updated(self, tracker_input: TrackerInput, before: BoxTrack) -> BoxTrack:
        """Predict, observe, search, and correct."""
        predicted = self._predicted(before, tracker_input.stamp_s)
        predicted, observation = self._observe(tracker_input, predicted)
        found = self._find(before, predicted, observation)
        if found is None:
            return predicted.missed(observation)
        estimate, support = found
        state = self._motion.correct_heading(
            predicted.state.with_pose(estimate.pose, estimate.covariance)
        )
        corrected = replace(predicted, state=state)
        return corrected.seen(observation, support)

    def _predicted(self, before: BoxTrack, stamp_s: float) -> BoxTrack:
        if self._is_lost(before):
            return replace(before, stamp_s=stamp_s)  # the last estimate stays
        elapsed_s = min(stamp_s - before.stamp_s, 2 * self._config.lost_after_s)
        state = self._motion.predict(before.state, elapsed_s)
        travelled_m = float(np.hypot(*self._motion.velocity_m_s(state))) * elapsed_s
        ground = before.ground.moved(travelled_m)
        return replace(before, stamp_s=stamp_s, state=state, ground=ground)

    def _observe(
        self, tracker_input: TrackerInput, predicted: BoxTrack
    ) -> tuple[BoxTrack, ObjectObservation]:
        """Return the track with the ground below it, and the observed points above that ground."""
        size_m = predicted.shape.size_m
        deviation_m = np.sqrt(np.linalg.eigvalsh(predicted.state.covariance[:2, :2])[-1])
        margin_m = np.clip(REACH * deviation_m, *_SEARCH_MARGIN_M)
        reach_m = predicted.shape.radius_m + float(margin_m)
        around = tracker_input.in_world(
            tracker_input.points_near(predicted.position_world, reach_m)
        )
        ground = predicted.ground.updated(
            tracker_input, predicted.position_world, float(size_m[0]), around
        )
        above_m = around[:, 2] - ground.z_world_m
        is_above_ground = (above_m > _CLEARANCE_M) & (above_m < size_m[2] + _HEADROOM_M)
        observation = observation_of(
            around[is_above_ground], tracker_input.world_SE3_velo[:2, 3], _CELL_M
        )
        is_background = predicted.background.contains(observation.points_xy_m)
        observation = observation.downweighted(is_background, _BACKGROUND_WEIGHT)
        return replace(predicted, ground=ground), observation

    def _find(
        self, before: BoxTrack, predicted: BoxTrack, observation: ObjectObservation
    ) -> tuple[PoseEstimate, Support] | None:
        """Return the observed pose and its support, or None."""
        if len(observation) == 0:
            return None
        expected_reward = predicted.expected_reward(observation)
        priors = self._priors(before, predicted)
        estimate = search(predicted.shape, observation, priors, expected_reward)
        support = support_at(predicted.shape, observation, estimate.pose)
        share = _REACQUIRE_SHARE if before.is_hidden else _MIN_SHARE
        min_reward = max(_MIN_REWARD, _MIN_CONTRAST * support.penalty, share * expected_reward)
        is_accepted = (
            support.reward >= min_reward
            and min(squared_distance(estimate, prior) for prior in priors) <= _GATE
            and (not before.is_hidden or self._has_same_top(predicted, observation, support.top_m))
        )
        return (estimate, support) if is_accepted else None

    def _priors(self, before: BoxTrack, predicted: BoxTrack) -> tuple[PoseEstimate, ...]:
        """Return the predicted pose and, if the object may be static, the last one."""
        if not self._motion.may_be_static(before.state):
            return (predicted.estimate,)
        last, drift = before.estimate, np.eye(3) * _POSE_DRIFT**2
        return predicted.estimate, PoseEstimate(last.pose, last.covariance + drift)

    def _has_same_top(
        self, predicted: BoxTrack, observation: ObjectObservation, top_m: float
    ) -> bool:
        """Return whether a top at some z may be the object's, given the gaps between beams."""
        gap_m = self._sensor.elevation_step_rad * observation.distance_m(predicted.pose[:2])
        off_m = top_m - predicted.ground.z_world_m - predicted.mean_top_m
        return bool(abs(off_m) <= _REACQUIRE_TOP_M + gap_m)

    def _is_lost(self, track: BoxTrack) -> bool:
        return track.stamp_s - track.last_seen_s > self._config.lost_after_s

    def _tracked(self, tracker_input: TrackerInput, track: BoxTrack) -> TrackedObject:
        size_m, velocity = track.shape.size_m, self._motion.velocity_m_s(track.state)
        status = TrackStatus.SEEN
        if track.is_hidden:
            status = TrackStatus.LOST if self._is_lost(track) else TrackStatus.PREDICTED
        middle = track.position_world + np.array([0.0, 0.0, size_m[2] / 2])
        box = WorldBox(middle, size_m, float(track.pose[2]), np.append(velocity, 0.0))
        if status is not TrackStatus.LOST:
            ahead = self._motion.predict(track.state, 1 / self._sensor.rate_hz)
            box = replace(box, next_position_m=np.append(ahead.mean[:2], middle[2]))
        return box.observed_in(tracker_input, status)


@cache
def log_lidar_only() -> None:
    """Log once a process that images are not used."""
    log.info("The default tracker uses the LiDAR alone; images are not used.")
