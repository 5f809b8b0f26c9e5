"""The default: along the beams to the next return, between two beams along the column.

Beams of a spinning LiDAR lie in rows that are dense along the row and far from each other. So a gap
between returns of one beam takes the nearest of them, and what lies between two beams is interpolated:

    row of a beam      x x . x x     a gap: the nearest return of the row
                       | | | | |
                       o o o o o     between: on the surface through the rows above and below, if there
                       | | | | |              can be one, else the nearer row
    row of a beam      x x x x x

In inverse depth a plane is linear in the image's rows, so that the road comes out flat.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from perception.maps.filling import Filling
from perception.maps.projection import SparseMaps
from perception.types import Bool, Float32, Int


@dataclass(frozen=True)
class ColumnRules:
    """How far a return reaches along its row, and what is one surface.

    Attributes:
        squeeze_px: image columns that are filled as one, about the step of a beam.
        reach: squeezed columns that a return reaches to either side, where none is nearer.
        steepest_per_m_px: most change of inverse depth from row to row on one surface. A plane that
            passes the camera at d metres has 1 / (focal length * d): the road some 0.001 on KITTI.
    """

    squeeze_px: int = 2
    reach: int = 3
    steepest_per_m_px: float = 2e-3


@dataclass(frozen=True)
class _Anchors:
    """A cells that a return reaches, column after column, each from its top to its bottom.

    Attributes:
        cells: (A,) number of the cell, column * height + row.
        returns: (A,) the return.
        is_neighbor: (A - 1,) whether an anchor and the next are in one column.
        height: rows of a column.
    """

    cells: Int
    returns: Int
    is_neighbor: Bool
    height: int


def fill_columns(sparse: SparseMaps, rules: ColumnRules = ColumnRules()) -> Filling:
    """Fill along rows, then along columns; both maps from one set of anchors."""
    if not len(sparse):
        return Filling.empty(sparse.size_px)
    owners = _reach_along_rows(sparse, rules)
    is_known = np.asarray((owners >= 0).any(axis=1))
    anchors = _anchors(owners if is_known.all() else owners[is_known])
    inverse = np.reciprocal(sparse.depth_m)[anchors.returns]
    gap = np.diff(anchors.cells)
    is_surface = anchors.is_neighbor & (np.abs(np.diff(inverse)) <= rules.steepest_per_m_px * gap)
    halves = _Halves.between(anchors, is_surface)
    depth_m = np.reciprocal(halves.interpolate(inverse))
    reflectance = halves.interpolate(sparse.reflectance[anchors.returns])
    if not is_known.all():
        source = (np.cumsum(is_known) - 1)[nearest_true(is_known)]
        depth_m, reflectance = depth_m[source], reflectance[source]
    return Filling(
        _in_image(depth_m, sparse, sparse.depth_m, rules),
        _in_image(reflectance, sparse, sparse.reflectance, rules),
    )


def nearest_true(mask: Bool) -> Int:
    """Return for each place of a (K,) mask the place of the nearest that is true; one must be."""
    places = np.flatnonzero(mask)
    return places[np.searchsorted((places[1:] + places[:-1]) / 2, np.arange(len(mask)))]


def _reach_along_rows(sparse: SparseMaps, rules: ColumnRules) -> Int:
    """Return the (columns, rows) return that owns each squeezed cell: the nearest of its row, or -1.

    Rows begin with the highest return: what lies above has nothing to be filled from.
    """
    width, height = sparse.size_px[0], sparse.size_px[1] - _top(sparse)
    columns = -(-width // rules.squeeze_px)
    # A margin on both sides takes what reaches over the edge.
    owners = np.full((columns + 2 * rules.reach) * height, -1, np.int32)
    column = sparse.pixels[:, 0] // rules.squeeze_px + rules.reach
    home = column * height + sparse.pixels[:, 1] - _top(sparse)
    order = np.arange(len(sparse), dtype=np.int32)
    # From far to near, so that nearer returns overwrite; of several in a cell the least deep is last.
    for offset in range(rules.reach, 0, -1):
        owners[home + offset * height] = order
        owners[home - offset * height] = order
    owners[home] = order
    return owners.reshape(-1, height)[rules.reach : rules.reach + columns]


def _anchors(owners: Int) -> _Anchors:
    height = owners.shape[1]
    flat = owners.ravel()
    cells = np.flatnonzero(flat >= 0).astype(np.int32)
    is_neighbor = np.diff(cells // np.int32(height)) == 0
    return _Anchors(cells, flat[cells], np.asarray(is_neighbor), height)


@dataclass(frozen=True)
class _Halves:
    """Every cell belongs to the nearer anchor of its column, above or below it: to one of 2 A halves.

    Attributes:
        half: (cells,) number of each cell's half; anchor j has 2 j above it and 2 j + 1 from it on.
        rows: (cells,) from the anchor down to the cell.
        step: (A - 1,) one over the gap to the next anchor, 0 where no surface joins the two.
        height: rows of a column.
    """

    half: Int
    rows: Float32
    step: Float32
    height: int

    @classmethod
    def between(cls, anchors: _Anchors, is_surface: Bool) -> "_Halves":
        cells, height = anchors.cells, anchors.height
        gap, row = np.diff(cells), cells % np.int32(height)
        lengths = np.empty((len(cells), 2), np.int32)
        lengths[0, 0], lengths[-1, 1] = row[0], height - row[-1]
        lengths[1:, 0] = np.where(anchors.is_neighbor, gap // 2, row[1:])
        lengths[:-1, 1] = np.where(anchors.is_neighbor, gap - gap // 2, height - row[:-1])
        half = np.repeat(np.arange(lengths.size, dtype=np.int32), lengths.ravel())
        rows = np.arange(len(half), dtype=np.int32) - cells[half >> 1]
        step = np.where(is_surface, 1 / gap, 0).astype(np.float32)
        return cls(half, rows.astype(np.float32), step, height)

    def interpolate(self, values: Float32) -> Float32:
        """Return (columns, rows) from the (A,) values at the anchors."""
        slope = np.diff(values) * self.step
        slopes = np.zeros((len(values), 2), np.float32)
        slopes[1:, 0], slopes[:-1, 1] = slope, slope
        filled = slopes.ravel()[self.half]
        filled *= self.rows
        filled += np.repeat(values, 2)[self.half]
        return filled.reshape(-1, self.height)


def _in_image(
    columns: Float32, sparse: SparseMaps, measured: Float32, rules: ColumnRules
) -> Float32:
    """Return the (H, W) map of squeezed columns, every return at its own pixel."""
    size = (columns.shape[0] * rules.squeeze_px, columns.shape[1])
    wide = cv2.resize(cv2.transpose(columns), size, interpolation=cv2.INTER_NEAREST)
    dense = np.zeros(sparse.size_px[::-1], np.float32)
    dense[_top(sparse) :] = wide[:, : sparse.size_px[0]]
    dense[sparse.pixels[:, 1], sparse.pixels[:, 0]] = measured
    return dense


def _top(sparse: SparseMaps) -> int:
    return int(sparse.pixels[:, 1].min())
