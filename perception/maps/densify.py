"""Dense depth and reflectance maps by any method, with masks of measured and filled pixels (6.1.3, B.2.2)."""

from collections.abc import Callable, Mapping
from dataclasses import astuple, dataclass
from functools import cached_property
from typing import cast

import numpy as np

from perception.kernels.map_filling import FillingNumbers, fill_beams, fill_between_beams
from perception.maps.encoding import encode_depth, encode_reflectance
from perception.maps.filling import FilledMaps, first_rows
from perception.maps.projection import SparseMaps
from perception.maps.triangle_filling import fill_linear, fill_nearest_vertex
from perception.types import Bool, Float32, Float64, Int, MapMethod, UInt8

# Pixels farther than this from every return do not contribute to their neighbours.
_FARTHEST_PX = 24
Fill = Callable[[SparseMaps], FilledMaps]


@dataclass(frozen=True)
class ColumnFillingConfig:
    """Filling along beams and columns: what is one beam, and what is one surface.

    Attributes:
        column_width_px: Number of image columns that are filled as one, about the step of a beam.
        max_gap_px: Largest hole in pixels behind which a surface goes on.
        max_depth_ratio: Largest ratio of two inverse depths side by side on one surface.
        max_slope_per_m_px: Largest change of inverse depth (1/m) from row to row on one surface. A plane that passes
            the camera at d metres has 1 / (focal length * d): the default is one metre on KITTI.
        extension_ratio: Extension of a row past its end, as a share of the distance to the next beam.
    """

    column_width_px: int = 2
    max_gap_px: int = 16
    max_depth_ratio: float = 1.1
    max_slope_per_m_px: float = 1.4e-3
    extension_ratio: float = 0.25

    @property
    def max_steps(self) -> int:
        """Columns from a return to the next of its beam, at most."""
        return max(1, self.max_gap_px // self.column_width_px)


_CONFIG = ColumnFillingConfig()


def fill_columns(sparse: SparseMaps, config: ColumnFillingConfig = _CONFIG) -> FilledMaps:
    """Fill along rows, then along columns, below the highest returns; visible returns keep their values."""
    if not len(sparse):
        return FilledMaps.empty(sparse.size_px)
    width, height = sparse.size_px
    pixels = np.ascontiguousarray(sparse.pixels.T, np.int32)
    depths_m = np.ascontiguousarray(sparse.depth_m)
    bright = np.ascontiguousarray(sparse.reflectance)
    numbers = cast(FillingNumbers, astuple(config))
    top = int(pixels[1].min())
    beams = fill_beams(pixels, depths_m, bright, width, height, top, numbers)
    begins = np.arange(0, width, config.column_width_px)
    first = np.minimum.reduceat(first_rows(sparse), begins).astype(np.int64)
    depth_m, reflectance = fill_between_beams(beams, first, width, height, top, numbers)
    # Returns that the camera does not see are left out.
    at = depth_m.ravel()[sparse.flat_indices]
    seen = np.flatnonzero(sparse.depth_m <= config.max_depth_ratio * at)
    flat_indices = sparse.flat_indices[seen]
    depth_m.ravel()[flat_indices] = sparse.depth_m[seen]
    reflectance.ravel()[flat_indices] = sparse.reflectance[seen]
    return FilledMaps(depth_m, reflectance)


def fill_nearest(sparse: SparseMaps) -> FilledMaps:
    """Give every pixel the depth and reflectance of the nearest return, exactly."""
    if not len(sparse):
        return FilledMaps.empty(sparse.size_px)
    nearest = _nearest_return(sparse)
    return FilledMaps(sparse.depth_m[nearest], sparse.reflectance[nearest])


def fill_natural(sparse: SparseMaps) -> FilledMaps:
    """Weigh returns by the area that each would lose to a pixel that joined them (Sibson), on the raster.

    A pixel is taken over by every pixel that is nearer to it than its own return. So each pixel gives the value of its
    return to all pixels of the disc up to that return, and their mean is the interpolation.
    """
    if not len(sparse):
        return FilledMaps.empty(sparse.size_px)
    nearest = _nearest_return(sparse)
    rows, columns = np.indices(nearest.shape)
    offset = np.stack([columns, rows], axis=-1) - sparse.pixels[nearest]
    squared_px = np.minimum((offset**2).sum(axis=-1), _FARTHEST_PX**2)
    weights = np.ones(len(sparse), np.float32)
    sums = [
        _sum_of_discs(squared_px, values[nearest])
        for values in (weights, sparse.depth_m, sparse.reflectance)
    ]
    count = np.maximum(sums[0], 1)
    means = [(total / count).astype(np.float32) for total in sums[1:]]
    return FilledMaps(means[0], means[1]).with_measured(sparse)


def _nearest_return(sparse: SparseMaps) -> Int:
    """Return the (H, W) nearest return of every pixel."""
    numbers = np.zeros(sparse.size_px[::-1], np.int32)
    numbers[sparse.pixels[:, 1], sparse.pixels[:, 0]] = np.arange(len(sparse))
    from scipy.ndimage import distance_transform_edt

    rows, columns = distance_transform_edt(
        ~sparse.is_measured, return_distances=False, return_indices=True
    )
    return np.asarray(numbers[rows, columns])


def _sum_of_discs(squared_px: Int, values: Float32) -> Float64:
    """Add each pixel's value to all pixels strictly within its own (squared) radius.

    A disc is a span in each row: its value enters where the span begins and leaves behind its end.
    """
    height, width = values.shape
    edges = np.zeros(height * (width + 1))
    order = np.argsort(-squared_px, axis=None, kind="stable")
    row, column = np.divmod(order, width)
    squared, value = squared_px.ravel()[order], values.ravel()[order]
    for down in range(-_FARTHEST_PX + 1, _FARTHEST_PX):
        reaching = int(np.searchsorted(-squared, -(down**2), side="left"))
        inside = np.flatnonzero((row[:reaching] + down >= 0) & (row[:reaching] + down < height))
        half = np.ceil(np.sqrt(squared[inside] - down**2)).astype(np.int64) - 1
        start = np.maximum(column[inside] - half, 0)
        stop = np.minimum(column[inside] + half + 1, width)
        base = (row[inside] + down) * (width + 1)
        edges += np.bincount(base + start, value[inside], len(edges))
        edges -= np.bincount(base + stop, value[inside], len(edges))
    return np.asarray(edges.reshape(height, width + 1).cumsum(axis=1)[:, :width])


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
