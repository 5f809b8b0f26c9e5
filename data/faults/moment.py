"""What a fault may use of a drive: the frame as it is, those before it, and chance."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from perception.types import Frame


@dataclass(frozen=True)
class FaultMoment:
    """One frame of a fault.

    Attributes:
        frame: Frame as the sensors gave it.
        before: Frame before it, as the sensors gave it; the frame itself where it is the first.
        start: Last frame before the fault; the first frame of the fault where there is none.
        count: Number of frames of the fault before this one.
        seed: Seed of the fault, the same in all its frames.
    """

    frame: Frame
    before: Frame
    start: Frame
    count: int
    seed: int

    @property
    def lasting(self) -> np.random.Generator:
        """Generator that draws the same in every frame of the fault: what stays, such as the place of dirt."""
        return np.random.default_rng((self.seed, 0))

    @property
    def passing(self) -> np.random.Generator:
        """Generator that draws anew in every frame: what passes, such as raindrops."""
        return np.random.default_rng((self.seed, 1 + self.count))

    @property
    def elapsed_s(self) -> float:
        """Time since the last frame before the fault in seconds."""
        return self.frame.stamp_s - self.start.stamp_s


# Makes a frame of the fault, of a size.
FaultFunction = Callable[[FaultMoment, float], Frame]
