"""Reference implementation of the adaptive colour model: one filter per bin, in a loop.

It gives what the batched filters must give, line by line as the thesis describes it (5.3.3, Adaptive Updating of ℜ
Bins), and it is what took most of the thesis' time a frame (7.1.2, Computational Analysis).
"""

import numpy as np

from benchmarks.reference.point_tracker import ReferenceKalmanFilter
from perception.tracking.single_object.config import ColorModelConfig
from perception.types import Float64

BINS = ColorModelConfig().bins
_STEP_S = 0.1


class ReferenceAdaptiveColors:
    """`AdaptiveColorModel` with a filter of its own for every bin."""

    def __init__(self) -> None:
        self.filters: dict[int, ReferenceKalmanFilter] = {}

    @property
    def ratios(self) -> Float64:
        """(512,) filtered model, at most 1."""
        ratios = np.zeros(BINS)
        for bin_number, state in self.filters.items():
            ratios[bin_number] = state.mean[0]
        return ratios / ratios.max() if ratios.any() else ratios

    def update(self, ratios: Float64) -> None:
        """Take in the (512,) colour model of one more image."""
        for bin_number, value in enumerate(ratios):
            if value <= 0:
                self.filters.pop(bin_number, None)
            elif bin_number in self.filters:
                self._step(bin_number, value)
            else:
                self.filters[bin_number] = ReferenceKalmanFilter(np.array([value, 0, 0]), np.eye(3))

    def _step(self, bin_number: int, value: float) -> None:
        transition = np.array([[1, _STEP_S, _STEP_S**2 / 2], [0, 1, _STEP_S], [0, 0, 1]])
        state = self.filters[bin_number]
        state.predict(transition, 0.1 * np.eye(3))
        state.update(np.array([value]), np.eye(1, 3), np.eye(1))
        if state.mean[0] <= 0:
            del self.filters[bin_number]


def wandering_ratios(in_use: int, frames: int, seed: int = 0) -> Float64:
    """Simulate (F, 512) colour models whose bins in use change slowly, one in ten now and then missing."""
    rng = np.random.default_rng(seed)
    bins = rng.choice(BINS, in_use, replace=False)
    values = rng.uniform(0.1, 1.0, in_use) + rng.normal(0, 0.05, (frames, in_use)).cumsum(axis=0)
    is_observed = rng.random((frames, in_use)) > 0.1
    ratios = np.zeros((frames, BINS))
    ratios[:, bins] = np.where(is_observed, np.clip(values, 0, 1), 0)
    return ratios
