"""From sparse to dense: depth and reflectance map by any method, and what of them is measured (6.1.3, B.2.2)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from perception.maps.column_filling import fill_columns, nearest_true
from perception.maps.distance_filling import fill_natural, fill_nearest
from perception.maps.filling import Filling
from perception.maps.projection import SparseMaps
from perception.maps.triangle_filling import fill_linear, fill_triangles
from perception.types import Bool, Float32

MapMethod = Literal["default", "thesis", "nearest", "linear", "natural"]
FILLINGS: Mapping[MapMethod, Callable[[SparseMaps], Filling]] = {
    "default": fill_columns,
    "thesis": fill_triangles,
    "nearest": fill_nearest,
    "linear": fill_linear,
    "natural": fill_natural,
}

# The author's program widens the region by a rectangle of 2 x 10 pixels.
_WIDER_PX, _HIGHER_PX = 10, 2


@dataclass(frozen=True)
class DenseMaps:
    """A depth and a reflectance map, and where to trust them.

    Attributes:
        depth_m: (H, W), 0 where not valid.
        reflectance: (H, W) from 0 to 1, 0 where not valid.
        is_measured: (H, W) a return lies in the pixel.
        is_filled: (H, W) the value comes from returns around.
    """

    depth_m: Float32
    reflectance: Float32
    is_measured: Bool
    is_filled: Bool

    @property
    def is_valid(self) -> Bool:
        """(H, W) measured or filled."""
        return self.is_measured | self.is_filled


def densify(sparse: SparseMaps, method: MapMethod = "default") -> DenseMaps:
    """Fill both maps within the region of interest.

    Args:
        sparse: the returns in the image; none give maps without a valid pixel.
        method: `default` along beams and columns, `thesis` the nearest vertex of the Delaunay triangle,
            `nearest` the nearest return, `linear` planes over the triangles, `natural` natural neighbours.
    """
    filling = FILLINGS[method](sparse)
    is_measured = sparse.is_measured
    is_valid = region_of_interest(sparse) & (filling.depth_m > 0)
    return DenseMaps(
        depth_m=filling.depth_m * is_valid,
        reflectance=filling.reflectance * is_valid,
        is_measured=is_measured,
        is_filled=is_valid & ~is_measured,
    )


def region_of_interest(sparse: SparseMaps) -> Bool:
    """Tell which (H, W) pixels lie below the highest return of the columns around.

    Above it the LiDAR sees nothing: sky, and what is over its highest beam.
    """
    width, height = sparse.size_px
    if not len(sparse):
        return np.zeros((height, width), bool)
    top = np.full(width, height, np.int32)
    np.minimum.at(top, sparse.pixels[:, 0], sparse.pixels[:, 1])
    top = top[nearest_true(top < height)]
    widened = cv2.erode(top.astype(np.float32)[None], np.ones((1, 2 * _WIDER_PX + 1), np.uint8))
    return np.asarray(np.arange(height)[:, None] >= widened - _HIGHER_PX)
