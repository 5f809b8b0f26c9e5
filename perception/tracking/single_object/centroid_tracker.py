"""Tracking loop of the thesis' trackers: predict, select the obstacle points nearby, locate the point, correct."""

from dataclasses import replace

import numpy as np

from perception.errors import PerceptionError
from perception.sensor import LidarModel
from perception.tracking.single_object.config import CentroidTrackerConfig
from perception.tracking.single_object.localizer import (
    LocalizerInput,
    ObjectLocalizer,
    Window,
    obstacles_near,
)
from perception.tracking.single_object.pitch_ground import PitchFilter
from perception.tracking.single_object.point_motion import (
    ConstantAcceleration,
    LastPosition,
    PointFilter,
    heading_from_course,
)
from perception.tracking.single_object.tracker import (
    TrackedObject,
    TrackerInput,
    TrackStatus,
    WorldBox,
    not_initialized,
    validate_initial_box,
)
from perception.types import Boxes3D, Float64, GroundModel


class CentroidTracker:
    """Tracks the point that a localizer finds, with the initial box around it; a `SingleObjectTracker`.

    Attributes:
        localizer: Finds the point.
        config: Ground, gate, motion and heading.
        pitch: Pitching ground plane.
        localizer_input: Last input of the localizer, or None before the first.
    """

    def __init__(
        self,
        localizer: ObjectLocalizer,
        sensor: LidarModel,
        config: CentroidTrackerConfig | None = None,
        *,
        has_filter: bool = True,
    ) -> None:
        """Create a tracker without an object.

        Args:
            localizer: Finds the point.
            sensor: LiDAR model.
            config: Ground, gate, motion and heading.
            has_filter: Whether the motion is filtered; otherwise the point stays where it was located.
        """
        self.localizer, self._sensor = localizer, sensor
        self.localizer_input: LocalizerInput | None = None
        self.config, self._has_filter = config or CentroidTrackerConfig(), has_filter
        self.pitch = PitchFilter(sensor.height_m, self.config.pitch)
        self._box: WorldBox | None = None

    def init(self, tracker_input: TrackerInput, box_velo: Boxes3D) -> TrackedObject:
        """Initialize the tracker with the object's box.

        Raises:
            PerceptionError: The box is not one finite box of positive size, or the localizer lacks a required
                input.
        """
        validate_initial_box(box_velo)
        self.pitch = PitchFilter(self._sensor.height_m, self.config.pitch)
        self._stamp_s, self._unseen_s = tracker_input.stamp_s, 0.0
        self._box = WorldBox.at_rest(box_velo, tracker_input.world_SE3_velo)
        position = self.localizer.init(self._localizer_input(tracker_input, self._box, 0.0))
        self._status = TrackStatus.PREDICTED if position is None else TrackStatus.SEEN
        self._motion = self._motion_at(self._box.position_m if position is None else position)
        return self._tracked(self._box, tracker_input)

    def update(self, tracker_input: TrackerInput) -> TrackedObject:
        """Track the object into the next frame.

        Raises:
            PerceptionError: The tracker has not been initialized.
        """
        if self._box is None:
            raise not_initialized("tracker of one object")
        elapsed_s, self._stamp_s = tracker_input.stamp_s - self._stamp_s, tracker_input.stamp_s
        # A scan that is given twice is no second measurement.
        if elapsed_s != 0:
            self._box = self._updated(self._box, tracker_input, elapsed_s)
        return self._tracked(self._box, tracker_input)

    def _tracked(self, box: WorldBox, tracker_input: TrackerInput) -> TrackedObject:
        """Return the object with its prediction of the next scan and its region of the image."""
        if self._status is not TrackStatus.LOST:
            period_s = 1 / self._sensor.rate_hz
            motion = self._motion.predicted(period_s, self.config.motion.process)
            box = replace(box, next_position_m=motion.position)
        return replace(box.observed_in(tracker_input, self._status), region=self.localizer.region)

    def _updated(self, last: WorldBox, tracker_input: TrackerInput, elapsed_s: float) -> WorldBox:
        if not 0 < elapsed_s <= self.config.max_gap_s:
            return self._set_lost(last)
        predicted = self._motion.predicted(elapsed_s, self.config.motion.process)
        expected = replace(last, position_m=predicted.position)
        position = self.localizer.locate(self._localizer_input(tracker_input, expected, elapsed_s))
        if position is None:
            return self._set_missed(last, predicted, elapsed_s)
        self._status, self._unseen_s = TrackStatus.SEEN, 0.0
        variances = np.array([self.config.motion.measurement])
        return self._move(last, predicted.corrected(position[None], variances), elapsed_s)

    def _set_missed(self, last: WorldBox, predicted: PointFilter, elapsed_s: float) -> WorldBox:
        """Keep the prediction, for a limited time."""
        self._unseen_s += elapsed_s
        if self._unseen_s > self.config.lost_after_s:
            return self._set_lost(last)
        self._status = TrackStatus.PREDICTED
        return self._move(last, predicted, elapsed_s)

    def _set_lost(self, last: WorldBox) -> WorldBox:
        """Wait at the last predicted position."""
        self._motion, self._status = self._motion_at(last.position_m), TrackStatus.LOST
        self._unseen_s = np.inf
        self.localizer.reset(last.position_m)
        return replace(last, velocity_m_s=np.zeros(3))

    def _move(self, last: WorldBox, motion: PointFilter, elapsed_s: float) -> WorldBox:
        """Move the box, and turn it along its course."""
        displacement_m = motion.position - self._motion.position
        yaw_rad = heading_from_course(
            displacement_m, elapsed_s, last.yaw_rad, last.size_m, self.config.course
        )
        self._motion = motion
        return WorldBox(motion.position, last.size_m, yaw_rad, motion.velocity)

    def _motion_at(self, position_m: Float64) -> PointFilter:
        if not self._has_filter:
            return LastPosition(position_m, np.zeros(3))
        return ConstantAcceleration.at_rest(position_m, self.config.motion.initial)

    def _localizer_input(
        self, tracker_input: TrackerInput, box: WorldBox, elapsed_s: float
    ) -> LocalizerInput:
        config = self.config
        window = Window(box.position_m, box.size_m[:2], box.yaw_rad)
        gate = window.scaled(config.gate)
        # From the middle of the gate to beyond its corners, as a window may lie partly outside.
        reach_m = float(np.hypot(*gate.size_m) + np.hypot(*window.size_m)) / 2
        heights_m = (config.min_height_m, float(box.size_m[2]) + config.headroom_m)
        ground = self._ground(tracker_input, elapsed_s)
        obstacles = obstacles_near(tracker_input, ground, box.position_m, reach_m, heights_m)
        self.localizer_input = LocalizerInput(
            tracker_input, ground, obstacles, window, gate, elapsed_s
        )
        return self.localizer_input

    def _ground(self, tracker_input: TrackerInput, elapsed_s: float) -> GroundModel:
        if self.config.ground == "pitch":
            return self.pitch.update(tracker_input.points_velo, elapsed_s)
        if tracker_input.ground is None:
            raise PerceptionError(
                "tracker of one object",
                expected="a ground model of the ground stage",
                found="none",
                advice="choose the ground that pitches",
            )
        return tracker_input.ground
