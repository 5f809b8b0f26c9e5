"""A rectangle over the ground: what a box is to whoever looks from above."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from perception.types import Bool, Float, Float64


@dataclass(frozen=True)
class Window:
    """Where points are looked for.

    Attributes:
        position_m: (3,) its centre; the height is carried along.
        size_m: (2,) length along the heading, and width.
        yaw_rad: heading.
    """

    position_m: Float64
    size_m: Float64
    yaw_rad: float

    def contains(self, points_m: Float) -> Bool:
        """Tell which (N, 2+) points lie over it, at any height."""
        x, y = (points_m[:, :2] - self.position_m[:2]).T
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        half_length_m, half_width_m = self.size_m / 2
        return np.asarray(
            (np.abs(cos * x + sin * y) <= half_length_m)
            & (np.abs(cos * y - sin * x) <= half_width_m)
        )

    def moved(self, position_m: Float64) -> Self:
        """Return it at another place."""
        return replace(self, position_m=position_m)

    def scaled(self, factor: float) -> Self:
        """Return it with another size."""
        return replace(self, size_m=self.size_m * factor)
