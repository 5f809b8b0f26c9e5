"""Filling within Delaunay triangles: the nearest vertex as in the thesis (6.3), or a plane. One triangulation each."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from perception.maps.filling import FilledMaps
from perception.maps.projection import SparseMaps
from perception.types import Float32, Float64, Int


@dataclass(frozen=True)
class _Covered:
    """The P pixels that lie within triangles.

    Attributes:
        flat_indices: (P,) row * width + column.
        pixels: (P, 2) column and row.
        corners: (P, 3) the returns at the triangle's vertices.
    """

    flat_indices: Int
    pixels: Int
    corners: Int


def fill_nearest_vertex(sparse: SparseMaps) -> FilledMaps:
    """Give every pixel within a triangle the value of the nearest of its vertices (6.3)."""
    covered = _triangulate(sparse)
    offset = sparse.pixels[covered.corners] - covered.pixels[:, None]
    closest = (offset**2).sum(axis=2).argmin(axis=1)
    weights = np.zeros(covered.corners.shape)
    weights[np.arange(len(closest)), closest] = 1
    return _filled(sparse, covered, weights)


def fill_linear(sparse: SparseMaps) -> FilledMaps:
    """Lay a plane through the vertices of every triangle (RMlinear of B.2.2)."""
    covered = _triangulate(sparse)
    first, second, third = np.moveaxis(sparse.pixels[covered.corners].astype(np.float64), 1, 0)
    along, across, to = second - first, third - first, covered.pixels - first
    area = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
    of_second = (to[:, 0] * across[:, 1] - to[:, 1] * across[:, 0]) / area
    of_third = (along[:, 0] * to[:, 1] - along[:, 1] * to[:, 0]) / area
    weights = np.stack([1 - of_second - of_third, of_second, of_third], axis=1)
    return _filled(sparse, covered, weights)


def _triangulate(sparse: SparseMaps) -> _Covered:
    """Find the triangle of each pixel; none where all returns are on one line."""
    width, height = sparse.size_px
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2)
    triangles = _triangles(sparse)
    if triangles is None:
        return _Covered(np.zeros(0, int), pixels[:0], np.zeros((0, 3), int))
    simplex = triangles.find_simplex(pixels)
    flat_indices = np.flatnonzero(simplex >= 0)
    return _Covered(flat_indices, pixels[flat_indices], triangles.simplices[simplex[flat_indices]])


def _filled(sparse: SparseMaps, covered: _Covered, weights: Float64) -> FilledMaps:
    def dense(values: Float32) -> Float32:
        flat = np.zeros(sparse.size_px[0] * sparse.size_px[1], np.float32)
        flat[covered.flat_indices] = (weights * values[covered.corners]).sum(axis=1)
        return flat.reshape(sparse.size_px[::-1])

    return FilledMaps(dense(sparse.depth_m), dense(sparse.reflectance)).with_measured(sparse)


def triangles_of(sparse: SparseMaps) -> Int:
    """Return the (T, 3) returns at the vertices of Delaunay triangles; none where all are on one line."""
    triangles = _triangles(sparse)
    return np.zeros((0, 3), np.int32) if triangles is None else np.asarray(triangles.simplices)


def _triangles(sparse: SparseMaps) -> Any:  # noqa: ANN401 - SciPy is not imported
    """Return the Delaunay triangles of the returns; None where all are on one line."""
    from scipy.spatial import Delaunay, QhullError

    try:
        return Delaunay(sparse.pixels.astype(np.float64))
    except (QhullError, ValueError):
        return None
