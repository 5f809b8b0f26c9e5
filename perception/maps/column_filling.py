"""Default filling: along the beams from return to return, between two beams along the column.

    row of a beam      o o . o o     a gap in a row: between its two sides, see `beam_rows`
                       | | | | |
                       . . . . .     between two rows: on the surface through both, if there can be one,
                       | | | | |     else the closer row
    row of a beam      o o o o o

In inverse depth a plane is linear in the rows of the image, so the road is filled as a plane.
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from cv2.typing import MatLike

from perception.maps.beam_rows import ColumnFillingConfig, ColumnGrid, fill_rows
from perception.maps.filling import FilledMaps, first_rows, nearest_true
from perception.maps.projection import SparseMaps
from perception.types import Bool, Complex64, Float32, Int

_CONFIG = ColumnFillingConfig()


def fill_columns(sparse: SparseMaps, config: ColumnFillingConfig = _CONFIG) -> FilledMaps:
    """Fill along rows, then along columns; both maps from one set of anchors."""
    if not len(sparse):
        return FilledMaps.empty(sparse.size_px)
    grid = ColumnGrid.over(sparse, config)
    filled = fill_rows(sparse, grid, config).reshape(-1, grid.rows)
    # Neither of the two numbers of a cell is -0: where a beam passes, some bit is set.
    is_passed = filled.view(np.int64) != 0
    is_known = is_passed.any(axis=1)
    if not is_known.all():
        nearest = nearest_true(is_known)
        filled, is_passed = filled[nearest], is_passed[nearest]
    cells = np.flatnonzero(is_passed)
    anchors = _Anchors(cells, filled.ravel()[cells], grid.rows).seen_by_camera(config)
    return _in_image(anchors.interpolate(config), grid, sparse, config)


@dataclass(frozen=True)
class _Anchors:
    """A cells that a beam passes, column after column, each from its top to its bottom.

    Attributes:
        cells: (A,) column * rows + row; every column has one.
        values: (A,) inverse depth + i reflectance.
        rows: Number of cells of a column.
    """

    cells: Int
    values: Complex64
    rows: int

    @cached_property
    def _is_neighbor(self) -> Bool:
        """(A - 1,) whether an anchor and the next are in one column."""
        return np.asarray(np.diff(self.cells // self.rows) == 0)

    def seen_by_camera(self, config: ColumnFillingConfig) -> "_Anchors":
        """Leave out anchors in a hole of a nearer surface.

        The LiDAR sees past an edge that hides it from the camera; the returns behind lie between
        the rows of the surface before them, as the teeth of two combs.
        """
        inverse = self.values.real
        above, below = inverse[:-1], inverse[1:]
        is_neighbor = self._is_neighbor
        recedes = is_neighbor & (above > config.max_depth_ratio * below)
        approaches = is_neighbor & (below > config.max_depth_ratio * above)
        is_narrow = self.cells[2:] - self.cells[:-2] <= config.max_gap_px
        is_observed = np.ones(len(self.cells), bool)
        is_observed[1:-1] = ~(recedes[:-1] & approaches[1:] & is_narrow)
        seen = np.flatnonzero(is_observed)
        return _Anchors(self.cells[seen], self.values[seen], self.rows)

    def interpolate(self, config: ColumnFillingConfig) -> Complex64:
        """Return the (columns, rows) values of all cells.

        From each anchor a line goes down, to the next one if both are on one surface. Where they are not,
        the line is level and ends half way: from there on, or from the top of the column, the next
        anchor's value holds. A line is a start + a slope * row.
        """
        column = self.cells // self.rows
        row = self.cells - column * self.rows
        gap, change = np.diff(self.cells).astype(np.float32), np.diff(self.values)
        is_surface = self._is_neighbor & (np.abs(change.real) <= config.max_slope_per_m_px * gap)
        slopes = np.zeros((len(row), 2), np.complex64)
        slopes[:-1, 1] = change * (is_surface / gap)
        starts = np.stack(
            [self.values, self.values - slopes[:, 1] * row.astype(np.float32)], axis=1
        )
        lengths = self._lengths(row, is_surface).ravel()
        cells = np.repeat(slopes.ravel(), lengths).view(np.float32).reshape(-1, 2 * self.rows)
        cells *= np.repeat(np.arange(self.rows, dtype=np.float32), 2)
        cells += np.repeat(starts.ravel(), lengths).view(np.float32).reshape(cells.shape)
        return cells.view(np.complex64)

    def _lengths(self, row: Int, is_surface: Bool) -> Int:
        """Return the (A, 2) cells above an anchor that are level with it, and from it on down."""
        gap, is_neighbor = np.diff(self.cells), self._is_neighbor
        lengths = np.empty((len(row), 2), np.intp)
        lengths[0, 0] = row[0]
        lengths[1:, 0] = np.where(is_neighbor, np.where(is_surface, 0, gap // 2), row[1:])
        lengths[:-1, 1] = gap - lengths[1:, 0]
        lengths[-1, 1] = self.rows - row[-1]
        return lengths


def _in_image(
    columns: Complex64, grid: ColumnGrid, sparse: SparseMaps, config: ColumnFillingConfig
) -> FilledMaps:
    """Return both maps within the region; a return that is visible to the camera keeps its value at its pixel."""
    both = columns[:, : grid.rows - 1].T
    begins = np.arange(0, sparse.size_px[0], config.column_width_px)
    first = np.minimum.reduceat(first_rows(sparse), begins) - grid.top
    is_inside = (np.arange(grid.rows - 1, dtype=np.int32)[:, None] >= first).view(np.uint8)
    inverse, reflectance = np.ascontiguousarray(both.real), np.ascontiguousarray(both.imag)
    depth_m = _widened(cv2.copyTo(np.reciprocal(inverse), is_inside), grid, sparse, config)
    whole = _widened(cv2.copyTo(reflectance, is_inside), grid, sparse, config)
    # Returns that the camera does not see are left out.
    seen = np.flatnonzero(
        sparse.depth_m <= config.max_depth_ratio * depth_m.ravel()[sparse.flat_indices]
    )
    flat_indices = sparse.flat_indices[seen]
    depth_m.ravel()[flat_indices] = sparse.depth_m[seen]
    whole.ravel()[flat_indices] = sparse.reflectance[seen]
    return FilledMaps(depth_m, whole)


def _widened(
    rows: MatLike, grid: ColumnGrid, sparse: SparseMaps, config: ColumnFillingConfig
) -> Float32:
    """Return (rows, columns) in an (H, W) map."""
    width, height = sparse.size_px
    image = np.empty((height, grid.columns * config.column_width_px), np.float32)
    image[: grid.top] = 0
    cv2.merge([rows] * config.column_width_px, image[grid.top :].reshape(*rows.shape, -1))
    return np.ascontiguousarray(image[:, :width])
