"""How a point goes on: with an acceleration that lasts (5.15), (5.17).

state     place   velocity   acceleration      (A numbers each; A = 3 in the world, 1 for an angle)
measured  place, once or several times, stacked as in (5.16)
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.tracking import kalman
from perception.tracking.kalman import Gaussians
from perception.types import Float64

# The author's noise is that of one step at the rate of KITTI's LiDAR.
_STEP_S = 0.1


@dataclass(frozen=True)
class NoiseLevels:
    """Variances of one filter, each the same for all numbers that it is about.

    Attributes:
        process: what a step of 0.1 s adds to each number of the state.
        first: of each number of the state in the beginning.
    """

    process: float
    first: float


@dataclass(frozen=True)
class ConstantAcceleration:
    """Where a point is, how it moves, and how well that is known.

    Attributes:
        states: one filter of 3 A numbers.
    """

    states: Gaussians

    @classmethod
    def at_rest(cls, position: Float64, noise: NoiseLevels) -> Self:
        """Begin at (A,) a place, without motion."""
        mean = np.concatenate([position, np.zeros(2 * len(position))])
        return cls(Gaussians(mean[None], noise.first * np.eye(len(mean))[None]))

    @property
    def position(self) -> Float64:
        """(A,)."""
        return self._third(0)

    @property
    def velocity(self) -> Float64:
        """(A,) per second."""
        return self._third(1)

    @property
    def position_covariance(self) -> Float64:
        """(A, A)."""
        axes = self.states.mean.shape[1] // 3
        return np.asarray(self.states.covariance[0, :axes, :axes])

    def predicted(self, elapsed_s: float, noise: NoiseLevels) -> Self:
        """Go on for a while."""
        axes = self.states.mean.shape[1] // 3
        steps = np.array([[1, elapsed_s, elapsed_s**2 / 2], [0, 1, elapsed_s], [0, 0, 1]])
        added = noise.process * elapsed_s / _STEP_S * np.eye(3 * axes)
        return type(self)(kalman.predict(self.states, np.kron(steps, np.eye(axes)), added))

    def corrected(self, positions: Float64, variances: Float64) -> Self:
        """Take in (K, A) measured places at once, (5.16), each with the variance (K,) of its numbers."""
        axes = positions.shape[1]
        observation = np.tile(np.eye(axes, 3 * axes), (len(positions), 1))
        noise = np.diag(np.repeat(variances, axes))
        return type(self)(kalman.update(self.states, positions.reshape(1, -1), observation, noise))

    def _third(self, number: int) -> Float64:
        return np.asarray(self.states.mean[0].reshape(3, -1)[number])
