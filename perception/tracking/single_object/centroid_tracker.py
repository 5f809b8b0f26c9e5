"""The loop that the thesis' trackers share: expect, look around, find the point, follow it."""

from dataclasses import dataclass, field, replace
from typing import Literal, Protocol, Self

import numpy as np

from perception.errors import PerceptionError
from perception.sensor import LidarModel
from perception.tracking.single_object.constant_acceleration import (
    ConstantAcceleration,
    NoiseLevels,
)
from perception.tracking.single_object.course import (
    heading_freeze_config_for,
    heading_from_course,
)
from perception.tracking.single_object.localizer import LocalizerInput, ObjectLocalizer
from perception.tracking.single_object.near_obstacles import obstacles_near
from perception.tracking.single_object.pitch_ground import PitchFilter, PitchFilterConfig
from perception.tracking.single_object.point_model import (
    PointModel,
    check_start_box,
    point_model_of,
    to_tracked_object,
)
from perception.tracking.single_object.tracker import TrackedObject, TrackerInput, TrackStatus
from perception.tracking.single_object.window import Window
from perception.types import Boxes3D, Float64, GroundModel


@dataclass(frozen=True)
class CentroidTrackerConfig:
    """What all trackers of a point have in common.

    Attributes:
        ground: the thesis' plane that pitches, or the ground of the obstacle stage.
        pitch: of the former.
        min_height_m: what is lower over the ground is ground.
        headroom_m: what is higher over the ground than the box by more is not the object.
        gate: length and width of the gate around the expected place, in those of the box.
        lost_after_s: an object unseen for longer is lost, and waited for where it was expected.
        max_gap_s: a scan that comes later, or before the last one, is not of the same drive.
    """

    ground: Literal["pitch", "stage"] = "pitch"
    pitch: PitchFilterConfig = field(default_factory=PitchFilterConfig)
    min_height_m: float = 0.20  # d_min, Table 7.5
    headroom_m: float = 0.5  # ours; the author's local grid ends 2 m up, for all objects
    gate: float = 2.0  # author's code: the best gate of App. A reaches one box to each side
    lost_after_s: float = 1.0  # ours
    max_gap_s: float = 1.0  # ours


@dataclass(frozen=True)
class PointMotionConfig:
    """The filter of the point's motion (5.17); values of the author's code.

    Attributes:
        noise: of the state.
        measured_variance: of one found place, in m².
    """

    noise: NoiseLevels = field(default_factory=lambda: NoiseLevels(process=3.0, first=1.0))
    measured_variance: float = 1.0


class PointMotion(Protocol):
    """What is remembered of a point's motion."""

    @property
    def position(self) -> Float64:
        """(3,)."""
        ...

    @property
    def velocity(self) -> Float64:
        """(3,)."""
        ...

    def predicted(self, elapsed_s: float, noise: NoiseLevels) -> Self:
        """Go on for a while."""
        ...

    def corrected(self, positions: Float64, variances: Float64) -> Self:
        """Take in (K, 3) found places with their variances (K,)."""
        ...


@dataclass(frozen=True)
class LastPosition:
    """The memory of a tracker without a filter: a point stays where it was last found.

    Attributes:
        position: (3,).
        velocity: (3,) by which it got there.
        elapsed_s: since it was found.
    """

    position: Float64
    velocity: Float64
    elapsed_s: float = 0.0

    def predicted(self, elapsed_s: float, noise: NoiseLevels) -> Self:
        """Stay."""
        del noise
        return replace(self, elapsed_s=self.elapsed_s + elapsed_s)

    def corrected(self, positions: Float64, variances: Float64) -> Self:
        """Go to the found place."""
        del variances
        position = positions.mean(axis=0)
        return type(self)(position, (position - self.position) / self.elapsed_s)


class CentroidTracker:
    """Follows the point that a localizer finds; implements `SingleObjectTracker`."""

    def __init__(
        self,
        localizer: ObjectLocalizer,
        sensor: LidarModel,
        config: CentroidTrackerConfig | None = None,
        motion: PointMotionConfig | None = None,
    ) -> None:
        """Set up.

        Args:
            localizer: finds the point.
            sensor: the LiDAR.
            config: what all trackers of a point have in common.
            motion: how its motion is filtered; without, the point is where it was found.
        """
        self._localizer, self._sensor = localizer, sensor
        self._config, self._motion_config = config or CentroidTrackerConfig(), motion
        self._model: PointModel | None = None

    def start(self, tracker_input: TrackerInput, box_velo: Boxes3D) -> TrackedObject:
        """Begin with the object's box in the LiDAR frame of this moment; forget any object before.

        Raises:
            PerceptionError: the box is not one finite box of positive size, or the localizer lacks
                what it cannot do without.
        """
        check_start_box(box_velo)
        self._pitch = PitchFilter(self._sensor.height_m, self._config.pitch)
        self._stamp_s, self._unseen_s = tracker_input.stamp_s, 0.0
        self._model = point_model_of(box_velo, tracker_input.world_SE3_velo)
        position = self._localizer.init(self._localizer_input(tracker_input, self._model, 0.0))
        self._state = TrackStatus.PREDICTED if position is None else TrackStatus.SEEN
        self._motion = self._init_motion(self._model.position_m if position is None else position)
        return to_tracked_object(self._model, tracker_input, self._state)

    def update(self, tracker_input: TrackerInput) -> TrackedObject:
        """Say where the object is at the next moment.

        Raises:
            PerceptionError: no object was begun with.
        """
        if self._model is None:
            raise PerceptionError(
                "tracker of one object", expected="start before follow", found="no object"
            )
        elapsed_s, self._stamp_s = tracker_input.stamp_s - self._stamp_s, tracker_input.stamp_s
        # A scan that is given twice is no second witness.
        if elapsed_s != 0:
            self._model = self._updated(self._model, tracker_input, elapsed_s)
        return to_tracked_object(self._model, tracker_input, self._state)

    def _updated(
        self, last: PointModel, tracker_input: TrackerInput, elapsed_s: float
    ) -> PointModel:
        if not 0 < elapsed_s <= self._config.max_gap_s:
            return self._set_lost(last)
        noise = self._motion_config.noise if self._motion_config else NoiseLevels(0.0, 0.0)
        expected = self._motion.predicted(elapsed_s, noise)
        position = self._localizer.locate(
            self._localizer_input(
                tracker_input, replace(last, position_m=expected.position), elapsed_s
            )
        )
        if position is None:
            return self._set_missed(last, expected, elapsed_s)
        variance = self._motion_config.measured_variance if self._motion_config else 0.0
        self._state, self._unseen_s = TrackStatus.SEEN, 0.0
        return self._move(last, expected.corrected(position[None], np.array([variance])), elapsed_s)

    def _set_missed(self, last: PointModel, expected: PointMotion, elapsed_s: float) -> PointModel:
        """Let the prediction stand, but not for ever."""
        self._unseen_s += elapsed_s
        if self._unseen_s > self._config.lost_after_s:
            return self._set_lost(last)
        self._state = TrackStatus.PREDICTED
        return self._move(last, expected, elapsed_s)

    def _set_lost(self, last: PointModel) -> PointModel:
        """Wait where the object was last expected."""
        self._motion, self._state = self._init_motion(last.position_m), TrackStatus.LOST
        self._unseen_s = np.inf
        self._localizer.reset(last.position_m)
        return replace(last, velocity_m_s=np.zeros(3))

    def _move(self, last: PointModel, motion: PointMotion, elapsed_s: float) -> PointModel:
        """Remember the point, and turn its box along the way from where it was remembered before."""
        displacement_m = motion.position - self._motion.position
        config = heading_freeze_config_for(last.size_m)
        yaw_rad = heading_from_course(displacement_m, elapsed_s, last.yaw_rad, config)
        self._motion = motion
        return PointModel(motion.position, last.size_m, yaw_rad, motion.velocity)

    def _init_motion(self, position_m: Float64) -> PointMotion:
        if self._motion_config is None:
            return LastPosition(position_m, np.zeros(3))
        return ConstantAcceleration.at_rest(position_m, self._motion_config.noise)

    def _localizer_input(
        self, tracker_input: TrackerInput, model: PointModel, elapsed_s: float
    ) -> LocalizerInput:
        config = self._config
        window = Window(model.position_m, model.size_m[:2], model.yaw_rad)
        gate = window.scaled(config.gate)
        # From the middle of the gate to beyond its corners, by as much as a window may leave it.
        reach_m = float(np.hypot(*gate.size_m) + np.hypot(*window.size_m)) / 2
        heights_m = (config.min_height_m, float(model.size_m[2]) + config.headroom_m)
        ground = self._ground(tracker_input, elapsed_s)
        obstacles = obstacles_near(tracker_input, ground, model.position_m, reach_m, heights_m)
        return LocalizerInput(tracker_input, obstacles, window, gate, elapsed_s)

    def _ground(self, tracker_input: TrackerInput, elapsed_s: float) -> GroundModel:
        if self._config.ground == "pitch":
            return self._pitch.update(tracker_input.points_velo, elapsed_s)
        if tracker_input.ground is None:
            raise PerceptionError(
                "tracker of one object",
                expected="the ground of the obstacle stage",
                found="none",
                advice="choose the ground that pitches",
            )
        return tracker_input.ground
