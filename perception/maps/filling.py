"""Filled maps, and the region of the image in which a map may be filled."""

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from perception.kernels.map_filling import highest_rows
from perception.maps.projection import SparseMaps
from perception.types import Bool, Float32, Int

# The author's program widens the region by a rectangle of 2 x 10 pixels.
_WIDER_PX, _HIGHER_PX = 10, 2


def region_of_interest(sparse: SparseMaps) -> Bool:
    """Return which (H, W) pixels lie below the highest return of the columns around.

    Above it the LiDAR has no returns: there is sky, or its highest beam is lower.
    """
    rows = np.arange(sparse.size_px[1], dtype=np.int32)
    return np.asarray(rows[:, None] >= first_rows(sparse))


def first_rows(sparse: SparseMaps) -> Int:
    """Return the (W,) first row of the region in each column; the height of the image without a return."""
    width, height = sparse.size_px
    if not len(sparse):
        return np.full(width, height, np.int32)
    columns, rows = np.ascontiguousarray(sparse.pixels.T, np.int32)
    top = highest_rows(columns, rows, width, height)
    top = top[nearest_true(top < height)]
    around = np.ones((1, 2 * _WIDER_PX + 1), np.uint8)
    return np.asarray(cv2.erode(top[None].astype(np.float32), around)[0] - _HIGHER_PX, np.int32)


def nearest_true(mask: Bool) -> Int:
    """Return for each element of a (K,) mask the index of the nearest true one; there must be one."""
    places = np.flatnonzero(mask)
    return places[np.searchsorted((places[1:] + places[:-1]) / 2, np.arange(len(mask)))]


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
