"""The default tracker of one object: its box, fitted scan by scan to the points that it explains.

1. Motion says where the box should be: along its heading, as fast and as curved as before.
2. The points above the ground there are compared with the object's shape: the sides of its box that
   face the sensor, and what was seen of it so far. What stood beside it a moment ago is left out.
3. What is left possible corrects the motion. Where too few points speak for the object it is
   predicted, the search widens, and a place is taken only if shape, height and motion fit it.

The LiDAR alone is used. The box keeps the size of the first one.
"""

import logging
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from perception.errors import PerceptionError
from perception.geometry.boxes import transform_boxes
from perception.sensor import LidarModel
from perception.tracking.single_object.box.background_model import BackgroundModel
from perception.tracking.single_object.box.box_track import BoxTrack
from perception.tracking.single_object.box.local_ground import LocalGround, update_ground
from perception.tracking.single_object.box.object_motion import motion_model_for
from perception.tracking.single_object.box.object_shape import ObjectShape, ObjectShapeConfig
from perception.tracking.single_object.box.observation import (
    ObjectObservation,
    observation_of,
    points_around,
)
from perception.tracking.single_object.box.pose_search import (
    PoseEstimate,
    PoseSearchConfig,
    Support,
    search,
    squared_distance,
)
from perception.tracking.single_object.point_model import (
    PointModel,
    check_start_box,
    to_tracked_object,
)
from perception.tracking.single_object.tracker import TrackedObject, TrackerInput, TrackStatus
from perception.types import Boxes3D

_POSE_DRIFT = 0.02  # of what stands, in metres and radians: poses drift
_logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class BoxFitTrackerConfig:
    """When an object is seen, and what belongs to it.

    Attributes:
        initial_deviation_m: standard deviation of the first box along x and y.
        initial_deviation_rad: of its heading.
        clearance_m: points so near the ground may be ground.
        headroom_m: points so far above the box are not the object's.
        cell_m: points are gathered by cells of this edge.
        search_margin_m: how far around the box is looked at, least and most.
        background_weight: of a point where something else stood a moment ago.
        min_reward: of the points at the best pose, each worth up to 1, to be seen.
        min_contrast: of what speaks for it, against what speaks against it.
        gate: squared deviations from what is expected; 99 % of true ones are closer (chi-squared, 3).
        min_share: of the reward that the object used to have at this distance.
        reacquire_share: the same of an object that was hidden.
        reacquire_top_m: by so much the top of an object that returns may differ from what it was, besides
            what the beams miss.
        lost_after_s: without being seen.
        shape: of the object.
        search: of its pose.
    """

    initial_deviation_m: float = 0.1
    initial_deviation_rad: float = 0.08
    clearance_m: float = 0.2
    headroom_m: float = 0.3
    cell_m: float = 0.1
    search_margin_m: tuple[float, float] = (3.0, 6.0)
    background_weight: float = 0.1
    min_reward: float = 1.2
    min_contrast: float = 0.5
    gate: float = 11.3
    min_share: float = 0.1
    reacquire_share: float = 0.25
    reacquire_top_m: float = 0.25
    lost_after_s: float = 3.0
    shape: ObjectShapeConfig = field(default_factory=ObjectShapeConfig)
    search: PoseSearchConfig = field(default_factory=PoseSearchConfig)


class BoxFitTracker:
    """Follows one object by fitting its box; implements `SingleObjectTracker`."""

    def __init__(self, sensor: LidarModel, config: BoxFitTrackerConfig | None = None) -> None:
        self._sensor = sensor
        self._config = config or BoxFitTrackerConfig()
        self._track: BoxTrack | None = None

    def start(self, tracker_input: TrackerInput, box_velo: Boxes3D) -> TrackedObject:
        """Begin with the object's box in the LiDAR frame of this moment; forget any object before.

        Raises:
            PerceptionError: the box is not one finite box of positive size.
        """
        check_start_box(box_velo)
        _log_lidar_only()
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
            ground=LocalGround.of_box(float(box_world.bottom_m[0, 2])),
            shape=ObjectShape.of_box(size_m, config.shape),
            background=BackgroundModel(),
        )
        _, observation = self._observe(tracker_input, self._track)
        support = self._track.support(observation, self._track.pose)
        self._track = self._track.seen(observation, support)
        return self._report(tracker_input, self._track)

    def update(self, tracker_input: TrackerInput) -> TrackedObject:
        """Say where the object is at the next moment.

        Raises:
            PerceptionError: no object was given to follow.
        """
        if self._track is None:
            raise PerceptionError("tracker", expected="start before follow", found="no object")
        if (
            tracker_input.stamp_s > self._track.stamp_s
        ):  # a scan that is given twice says nothing new
            self._track = self._updated(tracker_input, self._track)
        return self._report(tracker_input, self._track)

    def _updated(self, tracker_input: TrackerInput, before: BoxTrack) -> BoxTrack:
        """Predict, look, search, and take in what was found."""
        expected = self._predicted(before, tracker_input.stamp_s)
        expected, observation = self._observe(tracker_input, expected)
        found = self._find(before, expected, observation)
        if found is None:
            return expected.missed(observation)
        estimate, support = found
        state = self._motion.correct_heading(
            expected.state.with_pose(estimate.pose, estimate.covariance)
        )
        return replace(expected, state=state).seen(observation, support)

    def _predicted(self, before: BoxTrack, stamp_s: float) -> BoxTrack:
        if self._is_lost(before):
            return replace(before, stamp_s=stamp_s)  # the last guess stays
        elapsed_s = min(stamp_s - before.stamp_s, 2 * self._config.lost_after_s)
        state = self._motion.predict(before.state, elapsed_s)
        travelled_m = float(np.hypot(*self._motion.velocity_m_s(state))) * elapsed_s
        return replace(
            before, stamp_s=stamp_s, state=state, ground=before.ground.moved(travelled_m)
        )

    def _observe(
        self, tracker_input: TrackerInput, expected: BoxTrack
    ) -> tuple[BoxTrack, ObjectObservation]:
        """Return the object with the ground below it, and what is seen above that ground."""
        config, size_m = self._config, expected.shape.size_m
        deviation_m = np.sqrt(np.linalg.eigvalsh(expected.state.covariance[:2, :2])[-1])
        margin_m = np.clip(config.search.reach * deviation_m, *config.search_margin_m)
        reach_m = expected.shape.radius_m + float(margin_m)
        around = points_around(tracker_input, expected.position_world, reach_m)
        ground = update_ground(
            expected.ground, expected.position_world, float(size_m[0]), tracker_input, around
        )
        above_m = around[:, 2] - ground.z_world_m
        is_above_ground = (above_m > config.clearance_m) & (above_m < size_m[2] + config.headroom_m)
        observation = observation_of(
            around[is_above_ground], tracker_input.world_SE3_velo[:2, 3], config.cell_m
        )
        known = expected.background.contains(observation.points_xy_m)
        return replace(expected, ground=ground), observation.downweighted(
            known, config.background_weight
        )

    def _find(
        self, before: BoxTrack, expected: BoxTrack, observation: ObjectObservation
    ) -> tuple[PoseEstimate, Support] | None:
        """Return where the object is seen and what supports it, or None."""
        if len(observation) == 0:
            return None
        config, reference_reward = self._config, expected.reference_reward_in(observation)
        priors = self._priors(before, expected)
        estimate = search(expected.shape, observation, priors, reference_reward, config.search)
        support = expected.support(observation, estimate.pose)
        share = config.reacquire_share if before.is_hidden else config.min_share
        least = max(
            config.min_reward, config.min_contrast * support.penalty, share * reference_reward
        )
        fits = (
            support.reward >= least
            and min(squared_distance(estimate, prior) for prior in priors) <= config.gate
            and (not before.is_hidden or self._is_as_high(expected, observation, support.top_m))
        )
        return (estimate, support) if fits else None

    def _priors(self, before: BoxTrack, expected: BoxTrack) -> tuple[PoseEstimate, ...]:
        """Return where the object is expected: further on, or where it was if it may stand."""
        if not self._motion.may_be_static(before.state):
            return (expected.estimate,)
        was = before.estimate
        return expected.estimate, PoseEstimate(
            was.pose, was.covariance + np.eye(3) * _POSE_DRIFT**2
        )

    def _is_as_high(self, expected: BoxTrack, observation: ObjectObservation, top_m: float) -> bool:
        """Tell whether a top at some z may be the object's, as far as beams and their gaps tell."""
        missed_m = self._sensor.elevation_step_rad * observation.distance_m(expected.pose[:2])
        off_m = top_m - expected.ground.z_world_m - expected.reference_top_m
        return bool(abs(off_m) <= self._config.reacquire_top_m + missed_m)

    def _is_lost(self, track: BoxTrack) -> bool:
        return track.stamp_s - track.last_seen_s > self._config.lost_after_s

    def _report(self, tracker_input: TrackerInput, track: BoxTrack) -> TrackedObject:
        size_m, velocity = track.shape.size_m, self._motion.velocity_m_s(track.state)
        state = TrackStatus.SEEN
        if track.is_hidden:
            state = TrackStatus.LOST if self._is_lost(track) else TrackStatus.PREDICTED
        middle = track.position_world + np.array([0.0, 0.0, size_m[2] / 2])
        model = PointModel(middle, size_m, float(track.pose[2]), np.append(velocity, 0.0))
        return to_tracked_object(model, tracker_input, state)


@cache
def _log_lidar_only() -> None:
    """Say once, however many objects are followed, that no camera is used."""
    _logger.info("The default tracker follows by LiDAR alone; images are not used.")
