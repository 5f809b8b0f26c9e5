"""How a followed object moves: along its heading, which turns.

state     x  y  yaw  speed  turn      (world that stands still; centre of the box)
measured  x  y  yaw                   as a belief: mean and covariance

A vehicle turns about its rear axle, so that its middle also moves sideways while it turns. Walkers turn
on the spot: their heading is that of their way, and they have no axle.
"""

from dataclasses import dataclass

import numpy as np

from perception.types import Float64

POSE = slice(0, 3)


@dataclass(frozen=True)
class TurningRules:
    """What is believed of how an object moves; standard deviations.

    Attributes:
        acceleration_m_s2: along the heading.
        sideways_m_s: of a velocity across the heading that lasts for one scan.
        turn_rad_s: of the rate at which the heading turns.
        turn_lasts_s: after so long a turn is forgotten but for a third.
        first_speed_m_s: of an object of which one box is known.
        first_turn_rad_s: of the same.
        axle_share: of its length by which the middle of a vehicle lies before its rear axle.
        may_reverse: whether it may move against its heading.
    """

    acceleration_m_s2: float
    sideways_m_s: float
    turn_rad_s: float
    turn_lasts_s: float
    first_speed_m_s: float
    first_turn_rad_s: float
    axle_share: float
    may_reverse: bool


VEHICLE = TurningRules(3.0, 0.15, 0.35, 1.5, 7.0, 0.2, 0.3, may_reverse=True)
TWO_WHEELER = TurningRules(2.0, 0.25, 0.6, 1.0, 4.0, 0.3, 0.2, may_reverse=False)
WALKER = TurningRules(1.5, 0.3, 1.0, 0.5, 1.2, 0.5, 0.0, may_reverse=False)


_VEHICLE_M = (2.4, 1.2)  # length and width from which an object is a vehicle
_WALKER_M = 1.3  # shorter objects walk
_STEP_S = 0.15  # longer times are predicted in steps


def rules_for(size_m: Float64) -> TurningRules:
    """Return how an object of (3,) a size moves."""
    if size_m[0] >= _VEHICLE_M[0] and size_m[1] >= _VEHICLE_M[1]:
        return VEHICLE
    return WALKER if size_m[0] < _WALKER_M else TWO_WHEELER


@dataclass(frozen=True)
class MovingState:
    """One object's state.

    Attributes:
        mean: (5,) x, y, yaw, speed, turn rate in the world.
        covariance: (5, 5).
    """

    mean: Float64
    covariance: Float64

    @property
    def velocity_world_m_s(self) -> Float64:
        """(2,) of the middle of the box, as if it went straight on."""
        yaw, speed = self.mean[2:4]
        return np.array([speed * np.cos(yaw), speed * np.sin(yaw)])


def begin(pose: Float64, deviations: Float64, rules: TurningRules) -> MovingState:
    """Return the state of an object of which one (3,) pose is known, with (3,) deviations."""
    spread = np.array([*deviations, rules.first_speed_m_s, rules.first_turn_rad_s])
    return MovingState(np.array([*pose, 0.0, 0.0]), np.diag(spread**2))


def predict(
    state: MovingState, elapsed_s: float, length_m: float, rules: TurningRules
) -> MovingState:
    """Let the object go on as it went, for a time."""
    steps = max(1, int(np.ceil(elapsed_s / _STEP_S)))
    for _ in range(steps):
        state = _predict_step(state, elapsed_s / steps, length_m, rules)
    return state


def _predict_step(
    state: MovingState, elapsed_s: float, length_m: float, rules: TurningRules
) -> MovingState:
    x, y, yaw, speed, turn = state.mean
    left = np.exp(-elapsed_s / rules.turn_lasts_s)
    middle_yaw = yaw + turn * elapsed_s / 2
    cos, sin = np.cos(middle_yaw), np.sin(middle_yaw)
    way_m, swing_m = speed * elapsed_s, turn * elapsed_s * rules.axle_share * length_m
    mean = np.array(
        [
            x + cos * way_m - sin * swing_m,
            y + sin * way_m + cos * swing_m,
            yaw + turn * elapsed_s,
            speed,
            turn * left,
        ]
    )
    arm_m = rules.axle_share * length_m
    by_yaw = np.array([-sin * way_m - cos * swing_m, cos * way_m - sin * swing_m])
    across = np.array([-sin, cos])
    transition = np.eye(5)
    transition[:2, 2] = by_yaw
    transition[:2, 3] = np.array([cos, sin]) * elapsed_s
    transition[:2, 4] = (by_yaw / 2 + across * arm_m) * elapsed_s
    transition[2, 4] = elapsed_s
    transition[4, 4] = left
    return MovingState(
        mean,
        transition @ state.covariance @ transition.T
        + _process_noise(np.array([cos, sin]), across, elapsed_s, rules),
    )


def _process_noise(
    along: Float64, across: Float64, elapsed_s: float, rules: TurningRules
) -> Float64:
    """Return what an unknown push along, across and around adds, constant meanwhile."""
    push = np.zeros((5, 3))
    push[:2, 0] = along * elapsed_s**2 / 2
    push[3, 0] = elapsed_s
    push[2:5:2, 1] = elapsed_s**2 / 2, elapsed_s
    push[:2, 2] = across * elapsed_s
    # In the long run the rate of turning is as spread as the rules say (Ornstein-Uhlenbeck).
    turn_push = rules.turn_rad_s * np.sqrt(2 / (rules.turn_lasts_s * elapsed_s))
    spread = (rules.acceleration_m_s2, turn_push, rules.sideways_m_s)
    return np.asarray((push * np.square(spread)) @ push.T)


def correct(state: MovingState, pose: Float64, pose_covariance: Float64) -> MovingState:
    """Replace what is believed of the pose; speed and turn follow as far as they hang on it.

    Args:
        state: predicted.
        pose: (3,) x, y, yaw, given the prediction and what was seen.
        pose_covariance: (3, 3) of it.
    """
    prior = state.covariance
    regression = np.linalg.solve(prior[POSE, POSE], prior[POSE]).T  # (5, 3), identity above
    mean = state.mean + regression @ (pose - state.mean[POSE])
    change = pose_covariance - prior[POSE, POSE]
    covariance = prior + regression @ change @ regression.T
    return MovingState(mean, (covariance + covariance.T) / 2)


def facing_its_way(state: MovingState, rules: TurningRules, least_speed_m_s: float) -> MovingState:
    """Turn around what cannot go backwards but does."""
    if rules.may_reverse or state.mean[3] > -least_speed_m_s:
        return state
    flip = np.diag([1.0, 1.0, 1.0, -1.0, 1.0])
    mean = flip @ state.mean + np.array([0, 0, np.pi, 0, 0])
    return MovingState(mean, flip @ state.covariance @ flip)
