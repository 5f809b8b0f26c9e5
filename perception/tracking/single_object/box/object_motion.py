"""Motion models of a tracked object: constant turn rate for vehicles and cyclists, constant velocity for pedestrians.

Both states begin with the pose, in the world; x and y are of the box's centre.

turn rate  x  y  yaw  speed  turn      A vehicle turns about its rear axle, so that its middle also moves sideways while
velocity   x  y  yaw  vx     vy        it turns. A pedestrian faces along the course.
"""

from dataclasses import dataclass

import numpy as np

from perception.geometry.se3 import wrap
from perception.tracking.single_object.config import (
    ObjectMotionConfig,
    TurnRateMotionConfig,
    WalkerMotionConfig,
)
from perception.types import Float64

POSE = slice(0, 3)
_STATIC_GATE = (
    6.0  # squared deviations of a pedestrian's velocity from 0 (95 %, chi-squared, 2 degrees)
)


@dataclass(frozen=True)
class KinematicState:
    """Pose and motion of one object.

    Attributes:
        mean: (5,) state, beginning with x, y, yaw in the world.
        covariance: (5, 5) covariance of the state.
    """

    mean: Float64
    covariance: Float64

    def with_pose(self, pose: Float64, pose_covariance: Float64) -> "KinematicState":
        """Return the state given the estimate of its pose; the rest follows by its correlation.

        Args:
            pose: (3,) x, y, yaw, given the prediction and the observation.
            pose_covariance: (3, 3) covariance of the pose.
        """
        prior = self.covariance
        regression = np.linalg.solve(prior[POSE, POSE], prior[POSE]).T  # (5, 3), identity above
        mean = self.mean + regression @ (pose - self.mean[POSE])
        covariance = prior + regression @ (pose_covariance - prior[POSE, POSE]) @ regression.T
        return KinematicState(mean, (covariance + covariance.T) / 2)


class ConstantTurnRateMotion:
    """Motion along a heading that turns at a decaying rate."""

    def __init__(
        self, length_m: float, config: TurnRateMotionConfig, max_step_s: float = 0.15
    ) -> None:
        """Create the model of one object.

        Args:
            length_m: Length of the object.
            config: Standard deviations.
            max_step_s: Maximum time of one prediction step.
        """
        self._config, self._max_step_s = config, max_step_s
        self._axle_m = config.axle_share * length_m

    def init(self, pose: Float64, deviations: Float64) -> KinematicState:
        """Return the initial state at (3,) a pose with (3,) standard deviations, of any speed."""
        config = self._config
        spread = np.array([*deviations, config.initial_speed_m_s, config.initial_turn_rate_rad_s])
        return KinematicState(np.array([*pose, 0.0, 0.0]), np.diag(spread**2))

    def predict(self, state: KinematicState, elapsed_s: float) -> KinematicState:
        """Return the state after a time, along the curve."""
        steps = max(1, int(np.ceil(elapsed_s / self._max_step_s)))
        for _ in range(steps):
            state = self._step(state, elapsed_s / steps)
        return state

    def _step(self, state: KinematicState, elapsed_s: float) -> KinematicState:
        x, y, yaw, speed, turn = state.mean
        decay = np.exp(-elapsed_s / self._config.turn_time_constant_s)
        middle_yaw = yaw + turn * elapsed_s / 2
        along = np.array([np.cos(middle_yaw), np.sin(middle_yaw)])
        across = np.array([-along[1], along[0]])
        displacement = along * speed * elapsed_s + across * turn * elapsed_s * self._axle_m
        mean = np.array(
            [x + displacement[0], y + displacement[1], yaw + turn * elapsed_s, speed, turn * decay]
        )
        by_yaw = np.array([-displacement[1], displacement[0]])
        transition = np.eye(5)
        transition[:2, 2] = by_yaw
        transition[:2, 3] = along * elapsed_s
        transition[:2, 4] = (by_yaw / 2 + across * self._axle_m) * elapsed_s
        transition[2, 4] = elapsed_s
        transition[4, 4] = decay
        noise = self._process_noise(along, across, state, elapsed_s)
        return KinematicState(mean, transition @ state.covariance @ transition.T + noise)

    def _process_noise(
        self, along: Float64, across: Float64, state: KinematicState, elapsed_s: float
    ) -> Float64:
        """Return the noise of an unknown acceleration along, across and around, constant for the step."""
        config = self._config
        push = np.zeros((5, 3))
        push[:2, 0] = along * elapsed_s**2 / 2
        push[3, 0] = elapsed_s
        push[2:5:2, 1] = elapsed_s**2 / 2, elapsed_s
        push[:2, 2] = across * elapsed_s
        speed_m_s = abs(state.mean[3]) + np.sqrt(state.covariance[3, 3])
        turn_rad_s = config.turn_rate_rad_s * min(1.0, speed_m_s / config.full_turn_speed_m_s)
        # In the long run the turn rate has the configured spread (Ornstein-Uhlenbeck).
        turn_push = turn_rad_s * np.sqrt(2 / (config.turn_time_constant_s * elapsed_s))
        spread = (config.acceleration_m_s2, turn_push, config.lateral_speed_m_s)
        return np.asarray((push * np.square(spread)) @ push.T)

    def correct_heading(self, state: KinematicState) -> KinematicState:
        """Turn an object round that moves backwards and cannot."""
        if self._config.may_reverse or state.mean[3] > -self._config.min_speed_m_s:
            return state
        flip = np.diag([1.0, 1.0, 1.0, -1.0, 1.0])
        turned = flip @ state.mean + np.array([0.0, 0.0, np.pi, 0.0, 0.0])
        return KinematicState(turned, flip @ state.covariance @ flip)

    def velocity_m_s(self, state: KinematicState) -> Float64:
        """Return (2,) the velocity over the ground, along the heading."""
        yaw, speed = state.mean[2:4]
        return np.array([speed * np.cos(yaw), speed * np.sin(yaw)])

    def may_be_static(self, state: KinematicState) -> bool:
        """Return whether the speed is within two standard deviations of zero."""
        return bool(abs(state.mean[3]) <= 2 * np.sqrt(state.covariance[3, 3]))


class ConstantVelocityMotion:
    """Motion of a pedestrian, in any direction."""

    def __init__(self, config: WalkerMotionConfig | None = None) -> None:
        self._config = config or WalkerMotionConfig()

    def init(self, pose: Float64, deviations: Float64) -> KinematicState:
        """Return the initial state at (3,) a pose with (3,) standard deviations, of any velocity."""
        speed_m_s = self._config.initial_speed_m_s
        spread = np.array([*deviations, speed_m_s, speed_m_s])
        return KinematicState(np.array([*pose, 0.0, 0.0]), np.diag(spread**2))

    def predict(self, state: KinematicState, elapsed_s: float) -> KinematicState:
        """Return the state after a time, straight on."""
        config = self._config
        transition = np.eye(5)
        transition[:2, 3:] = elapsed_s * np.eye(2)
        # Velocity and heading are random walks.
        walk = np.array([[elapsed_s**3 / 3, elapsed_s**2 / 2], [elapsed_s**2 / 2, elapsed_s]])
        noise = np.zeros((5, 5))
        noise[np.ix_([0, 3], [0, 3])] = noise[np.ix_([1, 4], [1, 4])] = (
            config.acceleration_m_s2**2 * config.acceleration_time_s * walk
        )
        is_walking = float(np.hypot(*state.mean[3:])) > config.min_speed_m_s
        turn_rate_rad_s = config.turn_rate_rad_s if is_walking else config.static_turn_rate_rad_s
        noise[2, 2] = turn_rate_rad_s**2 * elapsed_s
        return KinematicState(
            transition @ state.mean, transition @ state.covariance @ transition.T + noise
        )

    def correct_heading(self, state: KinematicState) -> KinematicState:
        """Turn the heading towards the course, by the gain of their variances."""
        config = self._config
        speed_m_s = float(np.hypot(*state.mean[3:]))
        if speed_m_s < config.min_speed_m_s:
            return state
        across = np.array([-state.mean[4], state.mean[3]]) / speed_m_s
        spread = float(across @ state.covariance[3:, 3:] @ across) / speed_m_s**2
        off_rad = float(wrap(np.arctan2(state.mean[4], state.mean[3]) - state.mean[2]))
        noise = config.course_deviation_rad**2 + spread
        gain = state.covariance[2, 2] / (state.covariance[2, 2] + noise)
        if abs(off_rad) > np.pi / 2 and spread < config.course_deviation_rad**2:
            gain = 1.0  # it turned round
        mean, covariance = state.mean.copy(), state.covariance.copy()
        mean[2] += gain * off_rad
        covariance[2] *= 1 - gain
        covariance[:, 2] *= 1 - gain
        covariance[2, 2] += gain**2 * noise
        return KinematicState(mean, covariance)

    def velocity_m_s(self, state: KinematicState) -> Float64:
        """Return (2,) the velocity over the ground."""
        return state.mean[3:]

    def may_be_static(self, state: KinematicState) -> bool:
        """Return whether the velocity is within its gate around zero."""
        velocity, spread = state.mean[3:], state.covariance[3:, 3:]
        return bool(velocity @ np.linalg.solve(spread, velocity) <= _STATIC_GATE)


ObjectMotionModel = ConstantTurnRateMotion | ConstantVelocityMotion


def motion_model_for(
    size_m: Float64, config: ObjectMotionConfig | None = None
) -> ObjectMotionModel:
    """Return the motion model of an object of (3,) a size."""
    config = config or ObjectMotionConfig()
    length_m, width_m = float(size_m[0]), float(size_m[1])
    min_length_m, min_width_m = config.min_vehicle_m
    if length_m >= min_length_m and width_m >= min_width_m:
        return ConstantTurnRateMotion(length_m, config.vehicle, config.max_step_s)
    if length_m < config.max_walker_m:
        return ConstantVelocityMotion(config.walker)
    return ConstantTurnRateMotion(length_m, config.cyclist, config.max_step_s)
