"""Motion models of a tracked object: constant turn rate for vehicles and cyclists, constant velocity for pedestrians.

Both states begin with the pose, in the world; x and y are of the box's centre.

turn rate  x  y  yaw  speed  turn      A vehicle turns about its rear axle, so that its middle also moves sideways while
velocity   x  y  yaw  vx     vy        it turns. A pedestrian faces along the course.
"""

from dataclasses import dataclass

import numpy as np

from perception.geometry.se3 import wrap
from perception.types import Float64

POSE = slice(0, 3)
# Speed above which a heading shows: backwards, of what is turned round, or of a pedestrian's course.
_MIN_SPEED_M_S = 0.4
_MAX_STEP_S = 0.15  # of a prediction with a constant turn rate
_MIN_VEHICLE_M = (2.4, 1.2)  # minimum length and width of a vehicle
_MAX_WALKER_M = 1.3  # maximum length of a pedestrian

# Motion of pedestrians; standard deviations.
_ACCELERATION_M_S2, _ACCELERATION_TIME_S = 1.5, 0.1  # along x and along y, and how long it lasts
_TURN_RATE_RAD_S, _STATIC_TURN_RATE_RAD_S = 0.6, 0.1  # within a second, walking and standing
_INITIAL_SPEED_M_S = 1.2  # along x and along y
_COURSE_DEVIATION_RAD = 0.3  # of the heading from the course
_STATIC_GATE = 6.0  # squared deviations of a pedestrian's velocity from 0 (95 %, chi-squared)


@dataclass(frozen=True)
class TurnRateMotion:
    """Constant turn rate and velocity of a vehicle or a cyclist; standard deviations.

    Attributes:
        acceleration_m_s2: Acceleration along the heading.
        lateral_speed_m_s: Velocity across the heading, constant for one scan.
        turn_rate_rad_s: Rate at which the heading turns.
        turn_time_constant_s: Time after which a turn has decayed to a third.
        full_turn_speed_m_s: Speed below which the turn rate decreases.
        initial_speed_m_s: Initial speed.
        initial_turn_rate_rad_s: Initial turn rate.
        axle_share: Distance from the rear axle to the middle, as a share of the length.
        may_reverse: Whether the object may move against its heading.
    """

    acceleration_m_s2: float
    lateral_speed_m_s: float
    turn_rate_rad_s: float
    turn_time_constant_s: float
    full_turn_speed_m_s: float
    initial_speed_m_s: float
    initial_turn_rate_rad_s: float
    axle_share: float
    may_reverse: bool


_VEHICLE = TurnRateMotion(3.0, 0.15, 0.35, 1.5, 2.0, 7.0, 0.2, axle_share=0.3, may_reverse=True)
_CYCLIST = TurnRateMotion(2.0, 0.25, 0.6, 1.0, 1.0, 4.0, 0.3, axle_share=0.2, may_reverse=False)


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

    def __init__(self, length_m: float, config: TurnRateMotion) -> None:
        self._config = config
        self._axle_m = config.axle_share * length_m

    def init(self, pose: Float64, deviations: Float64) -> KinematicState:
        """Return the initial state at (3,) a pose with (3,) standard deviations, of any speed."""
        config = self._config
        spread = np.array([*deviations, config.initial_speed_m_s, config.initial_turn_rate_rad_s])
        return KinematicState(np.array([*pose, 0.0, 0.0]), np.diag(spread**2))

    def predict(self, state: KinematicState, elapsed_s: float) -> KinematicState:
        """Return the state after a time, along the curve."""
        steps = max(1, int(np.ceil(elapsed_s / _MAX_STEP_S)))
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
        if self._config.may_reverse or state.mean[3] > -_MIN_SPEED_M_S:
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

    def init(self, pose: Float64, deviations: Float64) -> KinematicState:
        """Return the initial state at (3,) a pose with (3,) standard deviations, of any velocity."""
        spread = np.array([*deviations, _INITIAL_SPEED_M_S, _INITIAL_SPEED_M_S])
        return KinematicState(np.array([*pose, 0.0, 0.0]), np.diag(spread**2))

    def predict(self, state: KinematicState, elapsed_s: float) -> KinematicState:
        """Return the state after a time, straight on."""
        transition = np.eye(5)
        transition[:2, 3:] = elapsed_s * np.eye(2)
        # Velocity and heading are random walks.
        walk = np.array([[elapsed_s**3 / 3, elapsed_s**2 / 2], [elapsed_s**2 / 2, elapsed_s]])
        noise = np.zeros((5, 5))
        noise[np.ix_([0, 3], [0, 3])] = noise[np.ix_([1, 4], [1, 4])] = (
            _ACCELERATION_M_S2**2 * _ACCELERATION_TIME_S * walk
        )
        is_walking = float(np.hypot(*state.mean[3:])) > _MIN_SPEED_M_S
        turn_rate_rad_s = _TURN_RATE_RAD_S if is_walking else _STATIC_TURN_RATE_RAD_S
        noise[2, 2] = turn_rate_rad_s**2 * elapsed_s
        return KinematicState(
            transition @ state.mean, transition @ state.covariance @ transition.T + noise
        )

    def correct_heading(self, state: KinematicState) -> KinematicState:
        """Turn the heading towards the course, by the gain of their variances."""
        speed_m_s = float(np.hypot(*state.mean[3:]))
        if speed_m_s < _MIN_SPEED_M_S:
            return state
        across = np.array([-state.mean[4], state.mean[3]]) / speed_m_s
        spread = float(across @ state.covariance[3:, 3:] @ across) / speed_m_s**2
        off_rad = float(wrap(np.arctan2(state.mean[4], state.mean[3]) - state.mean[2]))
        noise = _COURSE_DEVIATION_RAD**2 + spread
        gain = state.covariance[2, 2] / (state.covariance[2, 2] + noise)
        if abs(off_rad) > np.pi / 2 and spread < _COURSE_DEVIATION_RAD**2:
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


def motion_model_for(size_m: Float64) -> ObjectMotionModel:
    """Return the motion model of an object of (3,) a size."""
    length_m, width_m = float(size_m[0]), float(size_m[1])
    if length_m >= _MIN_VEHICLE_M[0] and width_m >= _MIN_VEHICLE_M[1]:
        return ConstantTurnRateMotion(length_m, _VEHICLE)
    if length_m < _MAX_WALKER_M:
        return ConstantVelocityMotion()
    return ConstantTurnRateMotion(length_m, _CYCLIST)
