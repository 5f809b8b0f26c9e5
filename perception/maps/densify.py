"""Dense depth and reflectance maps by any method, with masks of measured and filled pixels (6.1.3, B.2.2)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from perception.maps.column_filling import fill_columns
from perception.maps.distance_filling import fill_natural, fill_nearest
from perception.maps.encoding import encode_depth, encode_reflectance
from perception.maps.filling import FilledMaps
from perception.maps.projection import SparseMaps
from perception.maps.triangle_filling import fill_linear, fill_nearest_vertex
from perception.types import Bool, Float32, MapMethod, UInt8

Fill = Callable[[SparseMaps], FilledMaps]


def _within_region(fill: Fill) -> Fill:
    return lambda sparse: fill(sparse).within_region(sparse)


FILL_METHODS: Mapping[MapMethod, Fill] = {
    "default": fill_columns,
    "thesis": _within_region(fill_nearest_vertex),
    "nearest": _within_region(fill_nearest),
    "linear": _within_region(fill_linear),
    "natural": _within_region(fill_natural),
}


@dataclass(frozen=True)
class DenseMaps:
    """A depth and a reflectance map, and which pixels are valid.

    Attributes:
        depth_m: (H, W), 0 where not valid.
        reflectance: (H, W) from 0 to 1, 0 where not valid.
        is_measured: (H, W) whether the value is that of a return in the pixel.
        is_filled: (H, W) whether the value is interpolated from returns around.
    """

    depth_m: Float32
    reflectance: Float32
    is_measured: Bool
    is_filled: Bool

    @cached_property
    def depth_image(self) -> UInt8:
        """(H, W) depths as 8-bit numbers, 0 where unknown, made once for all networks."""
        # An unknown depth is 0, which is encoded as the nearest: 0.
        return encode_depth(self.depth_m)

    @cached_property
    def reflectance_image(self) -> UInt8:
        """(H, W) reflectances as 8-bit numbers, 0 where unknown, made once for all networks."""
        return encode_reflectance(self.reflectance)

    @property
    def is_valid(self) -> Bool:
        """(H, W) measured or filled."""
        return self.is_measured | self.is_filled


def densify(sparse: SparseMaps, method: MapMethod = "default") -> DenseMaps:
    """Fill both maps within the region of interest.

    Args:
        sparse: Returns in the image; without any, no pixel of the maps is valid.
        method: `default` along beams and columns, `thesis` the nearest vertex of the Delaunay triangle,
            `nearest` the nearest return, `linear` planes over the triangles, `natural` natural neighbours.
    """
    return dense_maps(sparse, FILL_METHODS[method])


def dense_maps(sparse: SparseMaps, fill: Fill) -> DenseMaps:
    """Fill both maps by a given filling function."""
    filling = fill(sparse)
    is_valid = filling.depth_m > 0
    is_measured = _keeps_return(filling, sparse)
    return DenseMaps(filling.depth_m, filling.reflectance, is_measured, is_valid > is_measured)


def _keeps_return(filling: FilledMaps, sparse: SparseMaps) -> Bool:
    """Return which (H, W) pixels have the depth of a return in them: a method may leave out some returns."""
    is_measured = np.zeros(filling.depth_m.shape, bool)
    is_measured.ravel()[sparse.flat_indices] = (
        filling.depth_m.ravel()[sparse.flat_indices] == sparse.depth_m
    )
    return is_measured
