"""Result of every filling method."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.maps.projection import SparseMaps
from perception.maps.region import region_of_interest
from perception.types import Float32


@dataclass(frozen=True)
class FilledMaps:
    """Both maps over the whole image, as filled by a method.

    Attributes:
        depth_m: (H, W), 0 where the method has no value.
        reflectance: (H, W), 0 at the same pixels.
    """

    depth_m: Float32
    reflectance: Float32

    @classmethod
    def empty(cls, size_px: tuple[int, int]) -> Self:
        """Return maps of (width, height) without a value."""
        shape = size_px[::-1]
        return cls(np.zeros(shape, np.float32), np.zeros(shape, np.float32))

    def with_measured(self, sparse: SparseMaps) -> Self:
        """Return it with every return at its own pixel."""
        rows, columns = sparse.pixels[:, 1], sparse.pixels[:, 0]
        depth_m, reflectance = self.depth_m.copy(), self.reflectance.copy()
        depth_m[rows, columns] = sparse.depth_m
        reflectance[rows, columns] = sparse.reflectance
        return type(self)(depth_m, reflectance)

    def within_region(self, sparse: SparseMaps) -> Self:
        """Return it without values above the highest returns."""
        is_inside = region_of_interest(sparse)
        return type(self)(self.depth_m * is_inside, self.reflectance * is_inside)
