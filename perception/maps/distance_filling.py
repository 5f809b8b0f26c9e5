"""Filling by distance in the image: the nearest return, and natural neighbours. One distance transform each."""

import numpy as np

from perception.maps.filling import FilledMaps
from perception.maps.projection import SparseMaps
from perception.types import Float32, Float64, Int

# Pixels farther than this from every return do not contribute to their neighbours.
_FARTHEST_PX = 24


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
