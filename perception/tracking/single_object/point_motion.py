"""Motion of a point: constant acceleration (5.15), (5.17), or the last position; and the heading of its course (5.3.4).

state     position   velocity   acceleration      (A numbers each; A = 3 in the world, 1 for an angle)
measured  position, once or several times, stacked as in (5.16)
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from perception.tracking import kalman
from perception.tracking.kalman import Gaussians
from perception.tracking.single_object.config import CourseConfig
from perception.types import Float64

# The author's process noise belongs to one step at the rate of KITTI's LiDAR.
_NOMINAL_STEP_S = 0.1


@dataclass(frozen=True)
class LastPosition:
    """Motion without a filter: the point stays at its last measured position.

    Attributes:
        position: (A,) last measured position.
        velocity: (A,) velocity between the last two measured positions.
        elapsed_s: Time since the last measurement.
    """

    position: Float64
    velocity: Float64
    elapsed_s: float = 0.0

    def predicted(self, elapsed_s: float, process: float) -> Self:
        """Keep the position."""
        del process
        return replace(self, elapsed_s=self.elapsed_s + elapsed_s)

    def corrected(self, positions: Float64, variances: Float64) -> Self:
        """Move to the mean of the measured positions."""
        del variances
        position = positions.mean(axis=0)
        return type(self)(position, (position - self.position) / self.elapsed_s)


@dataclass(frozen=True)
class ConstantAcceleration:
    """Kalman filter of a point with constant acceleration.

    Attributes:
        states: One filter of 3 A numbers.
    """

    states: Gaussians

    @classmethod
    def at_rest(cls, position: Float64, initial: float) -> Self:
        """Return the filter at (A,) a position at rest; P0 is `initial` times the identity matrix."""
        mean = np.concatenate([position, np.zeros(2 * len(position))])
        return cls(Gaussians(mean[None], initial * np.eye(len(mean))[None]))

    @property
    def position(self) -> Float64:
        """(A,) position."""
        return self._third(0)

    @property
    def velocity(self) -> Float64:
        """(A,) velocity."""
        return self._third(1)

    def predicted(self, elapsed_s: float, process: float) -> Self:
        """Predict the state over a time; Q is `process` times the identity matrix every 0.1 s."""
        axes = self.states.mean.shape[1] // 3
        steps = np.array([[1, elapsed_s, elapsed_s**2 / 2], [0, 1, elapsed_s], [0, 0, 1]])
        added = process * elapsed_s / _NOMINAL_STEP_S * np.eye(3 * axes)
        return type(self)(kalman.predict(self.states, np.kron(steps, np.eye(axes)), added))

    def corrected(self, positions: Float64, variances: Float64) -> Self:
        """Correct the state by (K, A) positions at once (5.16), each with one of (K,) variances."""
        axes = positions.shape[1]
        observation = np.tile(np.eye(axes, 3 * axes), (len(positions), 1))
        noise = np.diag(np.repeat(variances, axes))
        return type(self)(kalman.update(self.states, positions.reshape(1, -1), observation, noise))

    def _third(self, number: int) -> Float64:
        return np.asarray(self.states.mean[0].reshape(3, -1)[number])


PointFilter = LastPosition | ConstantAcceleration


def heading_from_course(
    displacement_m: Float64,
    elapsed_s: float,
    last_yaw_rad: float,
    size_m: Float64,
    config: CourseConfig,
) -> float:
    """Return the heading of a displacement, or the last heading of an object that is too slow.

    Args:
        displacement_m: (2+,) displacement since the last scan.
        elapsed_s: Time since the last scan.
        last_yaw_rad: Heading in the last scan.
        size_m: (3,) size of the box.
        config: Speeds and turns, by the volume of the box.
    """
    length_m = float(np.hypot(displacement_m[0], displacement_m[1]))
    if length_m == 0 or elapsed_s <= 0:
        return last_yaw_rad
    is_vehicle = size_m.prod() > config.vehicle_volume_m3
    slow_m_s = config.slow_vehicle_m_s if is_vehicle else config.slow_m_s
    max_turn_rad = config.max_vehicle_turn_rad if is_vehicle else config.max_turn_rad
    yaw_rad = float(np.arctan2(displacement_m[1], displacement_m[0]))
    turn_rad = abs(np.angle(np.exp(1j * (yaw_rad - last_yaw_rad))))
    is_slow = length_m < slow_m_s * elapsed_s
    return last_yaw_rad if is_slow and turn_rad > max_turn_rad else yaw_rad
