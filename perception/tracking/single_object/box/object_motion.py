"""How a followed object moves: vehicles and cyclists along their heading, walkers any way.

Both states begin with the pose, in a world that stands still; x and y are of the box's centre.

wheels     x  y  yaw  speed  turn      A vehicle turns about its rear axle, so that its middle also
walker     x  y  yaw  vx     vy        moves sideways while it turns. A walker faces the way it goes.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from perception.geometry.angles import wrap
from perception.types import Float64

POSE = slice(0, 3)
_VEHICLE_M = (2.4, 1.2)  # length and width from which an object is a vehicle
_WALKER_M = 1.3  # shorter objects walk
_STEP_S = 0.15  # longer times are predicted in steps
_SCAN_S = 0.1  # over which an acceleration of a walker lasts


@dataclass(frozen=True)
class MotionState:
    """One object's state.

    Attributes:
        mean: (5,) beginning with x, y, yaw in the world.
        covariance: (5, 5).
    """

    mean: Float64
    covariance: Float64

    def with_pose(self, pose: Float64, pose_covariance: Float64) -> "MotionState":
        """Replace what is believed of the pose; the rest follows as far as it hangs on it.

        Args:
            pose: (3,) x, y, yaw, given the prediction and what was seen.
            pose_covariance: (3, 3) of it.
        """
        prior = self.covariance
        regression = np.linalg.solve(prior[POSE, POSE], prior[POSE]).T  # (5, 3), identity above
        mean = self.mean + regression @ (pose - self.mean[POSE])
        covariance = prior + regression @ (pose_covariance - prior[POSE, POSE]) @ regression.T
        return MotionState(mean, (covariance + covariance.T) / 2)


class ObjectMotionModel(Protocol):
    """How one kind of object moves."""

    def init(self, pose: Float64, deviations: Float64) -> MotionState:
        """Return the state of an object of which one (3,) pose is known, with (3,) deviations."""
        ...

    def predict(self, state: MotionState, elapsed_s: float) -> MotionState:
        """Let the object go on as it went, for a time."""
        ...

    def correct_heading(self, state: MotionState) -> MotionState:
        """Say what follows of a corrected state for the heading."""
        ...

    def velocity_m_s(self, state: MotionState) -> Float64:
        """Return (2,) over the ground, in the world."""
        ...

    def may_be_static(self, state: MotionState) -> bool:
        """Tell whether the object may stand, as far as is known."""
        ...


@dataclass(frozen=True)
class ConstantTurnRateMotion:
    """An object that goes along its heading, which turns while it goes; standard deviations.

    Attributes:
        acceleration_m_s2: along the heading.
        lateral_speed_m_s: of a velocity across the heading that lasts for one scan.
        turn_rate_rad_s: of the rate at which the heading turns.
        turn_time_constant_s: after so long a turn is forgotten but for a third.
        full_turn_speed_m_s: slower, it turns less.
        initial_speed_m_s: of an object of which one box is known.
        initial_turn_rate_rad_s: of the same.
        axle_m: from the rear axle to the middle.
        may_reverse: whether it may move against its heading.
        min_speed_m_s: what goes backwards faster, but cannot, faces the wrong way.
    """

    acceleration_m_s2: float
    lateral_speed_m_s: float
    turn_rate_rad_s: float
    turn_time_constant_s: float
    full_turn_speed_m_s: float
    initial_speed_m_s: float
    initial_turn_rate_rad_s: float
    axle_m: float
    may_reverse: bool
    min_speed_m_s: float = 0.4

    def init(self, pose: Float64, deviations: Float64) -> MotionState:
        """Begin with any speed."""
        spread = np.array([*deviations, self.initial_speed_m_s, self.initial_turn_rate_rad_s])
        return MotionState(np.array([*pose, 0.0, 0.0]), np.diag(spread**2))

    def predict(self, state: MotionState, elapsed_s: float) -> MotionState:
        """Go on along the curve."""
        steps = max(1, int(np.ceil(elapsed_s / _STEP_S)))
        for _ in range(steps):
            state = self._step(state, elapsed_s / steps)
        return state

    def _step(self, state: MotionState, elapsed_s: float) -> MotionState:
        x, y, yaw, speed, turn = state.mean
        left = np.exp(-elapsed_s / self.turn_time_constant_s)
        middle_yaw = yaw + turn * elapsed_s / 2
        along = np.array([np.cos(middle_yaw), np.sin(middle_yaw)])
        across = np.array([-along[1], along[0]])
        displacement = along * speed * elapsed_s + across * turn * elapsed_s * self.axle_m
        mean = np.array(
            [x + displacement[0], y + displacement[1], yaw + turn * elapsed_s, speed, turn * left]
        )
        by_yaw = np.array([-displacement[1], displacement[0]])
        transition = np.eye(5)
        transition[:2, 2] = by_yaw
        transition[:2, 3] = along * elapsed_s
        transition[:2, 4] = (by_yaw / 2 + across * self.axle_m) * elapsed_s
        transition[2, 4] = elapsed_s
        transition[4, 4] = left
        noise = self._process_noise(along, across, state, elapsed_s)
        return MotionState(mean, transition @ state.covariance @ transition.T + noise)

    def _process_noise(
        self, along: Float64, across: Float64, state: MotionState, elapsed_s: float
    ) -> Float64:
        """Return what an unknown push along, across and around adds, constant meanwhile."""
        push = np.zeros((5, 3))
        push[:2, 0] = along * elapsed_s**2 / 2
        push[3, 0] = elapsed_s
        push[2:5:2, 1] = elapsed_s**2 / 2, elapsed_s
        push[:2, 2] = across * elapsed_s
        speed_m_s = abs(state.mean[3]) + np.sqrt(state.covariance[3, 3])
        turn_rate_rad_s = self.turn_rate_rad_s * min(1.0, speed_m_s / self.full_turn_speed_m_s)
        # In the long run the rate of turning is as spread as the rules say (Ornstein-Uhlenbeck).
        turn_push = turn_rate_rad_s * np.sqrt(2 / (self.turn_time_constant_s * elapsed_s))
        spread = (self.acceleration_m_s2, turn_push, self.lateral_speed_m_s)
        return np.asarray((push * np.square(spread)) @ push.T)

    def correct_heading(self, state: MotionState) -> MotionState:
        """Turn around what cannot go backwards but does."""
        if self.may_reverse or state.mean[3] > -self.min_speed_m_s:
            return state
        flip = np.diag([1.0, 1.0, 1.0, -1.0, 1.0])
        turned = flip @ state.mean + np.array([0.0, 0.0, np.pi, 0.0, 0.0])
        return MotionState(turned, flip @ state.covariance @ flip)

    def velocity_m_s(self, state: MotionState) -> Float64:
        """Go along the heading."""
        yaw, speed = state.mean[2:4]
        return np.array([speed * np.cos(yaw), speed * np.sin(yaw)])

    def may_be_static(self, state: MotionState) -> bool:
        """Stand without speed."""
        return bool(abs(state.mean[3]) <= 2 * np.sqrt(state.covariance[3, 3]))


@dataclass(frozen=True)
class ConstantVelocityMotion:
    """A walker; standard deviations.

    Attributes:
        acceleration_m_s2: along x and along y.
        turn_rate_rad_s: of the heading that changes within a second, while the walker walks.
        static_turn_rate_rad_s: while it stands.
        initial_speed_m_s: along x and along y, of a walker of which one box is known.
        course_deviation_rad: of the heading from the way.
        min_speed_m_s: slower, the way tells no heading.
    """

    acceleration_m_s2: float = 1.5
    turn_rate_rad_s: float = 0.6
    static_turn_rate_rad_s: float = 0.1
    initial_speed_m_s: float = 1.2
    course_deviation_rad: float = 0.3
    min_speed_m_s: float = 0.4

    def init(self, pose: Float64, deviations: Float64) -> MotionState:
        """Begin with any velocity."""
        spread = np.array([*deviations, self.initial_speed_m_s, self.initial_speed_m_s])
        return MotionState(np.array([*pose, 0.0, 0.0]), np.diag(spread**2))

    def predict(self, state: MotionState, elapsed_s: float) -> MotionState:
        """Go straight on."""
        transition = np.eye(5)
        transition[:2, 3:] = elapsed_s * np.eye(2)
        # Velocity wanders; so does the heading.
        walk = np.array([[elapsed_s**3 / 3, elapsed_s**2 / 2], [elapsed_s**2 / 2, elapsed_s]])
        noise = np.zeros((5, 5))
        noise[np.ix_([0, 3], [0, 3])] = noise[np.ix_([1, 4], [1, 4])] = (
            self.acceleration_m_s2**2 * _SCAN_S * walk
        )
        speed_m_s = float(np.hypot(*state.mean[3:]))
        is_walking = speed_m_s > self.min_speed_m_s
        turn_rate_rad_s = self.turn_rate_rad_s if is_walking else self.static_turn_rate_rad_s
        noise[2, 2] = turn_rate_rad_s**2 * elapsed_s
        return MotionState(
            transition @ state.mean, transition @ state.covariance @ transition.T + noise
        )

    def correct_heading(self, state: MotionState) -> MotionState:
        """Turn the heading to the way, as far as that is known better."""
        speed_m_s = float(np.hypot(*state.mean[3:]))
        if speed_m_s < self.min_speed_m_s:
            return state
        across = np.array([-state.mean[4], state.mean[3]]) / speed_m_s
        spread = float(across @ state.covariance[3:, 3:] @ across) / speed_m_s**2
        off_rad = float(wrap(np.arctan2(state.mean[4], state.mean[3]) - state.mean[2]))
        noise = self.course_deviation_rad**2 + spread
        gain = state.covariance[2, 2] / (state.covariance[2, 2] + noise)
        if abs(off_rad) > np.pi / 2 and spread < self.course_deviation_rad**2:
            gain = 1.0  # it turned round
        mean, covariance = state.mean.copy(), state.covariance.copy()
        mean[2] += gain * off_rad
        covariance[2] *= 1 - gain
        covariance[:, 2] *= 1 - gain
        covariance[2, 2] += gain**2 * noise
        return MotionState(mean, covariance)

    def velocity_m_s(self, state: MotionState) -> Float64:
        """Go as the state says."""
        return state.mean[3:]

    def may_be_static(self, state: MotionState) -> bool:
        """Stand without velocity."""
        velocity, spread = state.mean[3:], state.covariance[3:, 3:]
        return bool(velocity @ np.linalg.solve(spread, velocity) <= 6.0)


def motion_model_for(size_m: Float64) -> ObjectMotionModel:
    """Return how an object of (3,) a size moves."""
    length_m, width_m = float(size_m[0]), float(size_m[1])
    if length_m >= _VEHICLE_M[0] and width_m >= _VEHICLE_M[1]:
        return ConstantTurnRateMotion(
            acceleration_m_s2=3.0,  # a car brakes so
            lateral_speed_m_s=0.15,
            turn_rate_rad_s=0.35,
            turn_time_constant_s=1.5,
            full_turn_speed_m_s=2.0,
            initial_speed_m_s=7.0,
            initial_turn_rate_rad_s=0.2,
            axle_m=0.3 * length_m,
            may_reverse=True,
        )
    if length_m < _WALKER_M:
        return ConstantVelocityMotion()
    return ConstantTurnRateMotion(
        acceleration_m_s2=2.0,
        lateral_speed_m_s=0.25,
        turn_rate_rad_s=0.6,
        turn_time_constant_s=1.0,
        full_turn_speed_m_s=1.0,
        initial_speed_m_s=4.0,
        initial_turn_rate_rad_s=0.3,
        axle_m=0.2 * length_m,
        may_reverse=False,
    )
