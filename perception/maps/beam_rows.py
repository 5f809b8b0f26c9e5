"""Beams of a spinning LiDAR in the image: rows of returns, each linked to the next.

    o   o   o   .   o   o                  o  a return; its beam goes on in one of the columns to its right,
                            o   +          at most a row higher or lower
                                           .  a gap: between the returns on both sides
                                           +  an end: goes on for a part of the way to the next beam

Columns are about as wide as a beam's step, so that most of them hold a return of each beam.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.maps.projection import SparseMaps
from perception.types import Bool, Complex64, Int


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


@dataclass(frozen=True)
class ColumnGrid:
    """Cells in columns, one after the other, each from the highest return down and with a blank cell below.

    Attributes:
        columns: Number of columns without the margins.
        rows: Number of cells of a column, with the blank one.
        top: Image row of the highest return; nothing is filled above it.
        margin: Number of extra columns on either side.
    """

    columns: int
    rows: int
    top: int
    margin: int

    @classmethod
    def over(cls, sparse: SparseMaps, config: ColumnFillingConfig) -> Self:
        """Return the grid over an image with at least one return."""
        width, height = sparse.size_px
        top = int(sparse.pixels[:, 1].min())
        return cls(-(-width // config.column_width_px), height - top + 1, top, config.max_steps)

    def cells_of(self, sparse: SparseMaps, config: ColumnFillingConfig) -> Int:
        """Return the (N,) cell of each return, counted from the left margin on."""
        column = sparse.pixels[:, 0] // config.column_width_px + self.margin
        return np.asarray(column * self.rows + (sparse.pixels[:, 1] - self.top), np.intp)

    def zeros(self, kind: type) -> np.ndarray:
        """Return an array of all cells, margins included."""
        return np.zeros((self.columns + 2 * self.margin) * self.rows, kind)

    def within(self, cells: np.ndarray) -> np.ndarray:
        """Return such an array without its margins."""
        return cells[self.margin * self.rows : (self.margin + self.columns) * self.rows]


@dataclass(frozen=True)
class _Returns:
    """K returns, at most one a cell, and the next of each one's beam; the farthest first.

    Attributes:
        cells: (K,) cell of each return.
        values: (K,) inverse depth + i reflectance.
        following: (K,) next return of the same beam, where there is one.
        steps: (K,) columns to it, 0 where there is none.
    """

    cells: Int
    values: Complex64
    following: Int
    steps: Int


def fill_rows(sparse: SparseMaps, grid: ColumnGrid, config: ColumnFillingConfig) -> Complex64:
    """Return inverse depth + i reflectance along the beams in each cell, 0 where none passes.

    One complex number holds both maps: all operations on them are linear.
    """
    returns = _linked(sparse, grid, config)
    filled = grid.zeros(np.complex64)
    # Values of the lowest priority come first and are overwritten; of equal ones, the nearest comes last.
    _extend_ends(filled, returns, grid, config)
    _bridge_gaps(filled, returns, grid, config)
    filled[returns.cells] = returns.values
    return np.asarray(grid.within(filled))


def _linked(sparse: SparseMaps, grid: ColumnGrid, config: ColumnFillingConfig) -> _Returns:
    """Find the next return of each beam: in the nearest column, there in the same row if possible."""
    cells, number = grid.cells_of(sparse, config), np.arange(len(sparse))
    at = grid.zeros(np.int32) - 1
    at[cells] = number
    owns = np.flatnonzero(at[cells] == number)
    cells, number = cells[owns], number[: len(owns)]
    at[cells - 1] = number
    at[cells + 1] = number
    at[cells] = number
    at[grid.rows - 1 :: grid.rows] = -1
    following, steps = np.asarray(at[cells + grid.rows], np.intp), np.ones(len(cells), np.intp)
    unlinked = np.flatnonzero(following < 0)
    for step in range(2, config.max_steps + 1):
        found = at[cells[unlinked] + step * grid.rows]
        following[unlinked], steps[unlinked] = found, step
        unlinked = unlinked[found < 0]
    steps[unlinked] = 0
    values = np.empty(len(cells), np.complex64)
    values.real, values.imag = np.reciprocal(sparse.depth_m[owns]), sparse.reflectance[owns]
    return _Returns(cells, values, following, steps)


def _extend_ends(
    filled: Complex64, returns: _Returns, grid: ColumnGrid, config: ColumnFillingConfig
) -> None:
    is_first = np.ones(len(returns.cells), bool)
    is_first[returns.following[np.flatnonzero(returns.steps)]] = False
    last, first = np.flatnonzero(returns.steps == 0), np.flatnonzero(is_first)
    for step in range(_extension_columns(returns.cells, grid, config), 0, -1):
        for ends, way in ((last, grid.rows), (first, -grid.rows)):
            filled[returns.cells[ends] + step * way] = returns.values[ends]


def _extension_columns(cells: Int, grid: ColumnGrid, config: ColumnFillingConfig) -> int:
    """Return the number of columns by which a row is extended; the beams' distance is the median gap in the columns."""
    is_return = grid.zeros(bool)
    is_return[cells] = True
    in_order = np.flatnonzero(is_return)
    gaps = np.diff(in_order)
    gaps = gaps[np.flatnonzero((gaps > 1) & (np.diff(in_order // grid.rows) == 0))]
    spacing_px = float(np.median(gaps)) if len(gaps) else 0.0
    return min(
        max(1, round(config.extension_ratio * spacing_px / config.column_width_px)), grid.margin
    )


def _bridge_gaps(
    filled: Complex64, returns: _Returns, grid: ColumnGrid, config: ColumnFillingConfig
) -> None:
    """Interpolate between the two sides of a gap if they are one surface, else take the closer side."""
    begin = np.flatnonzero(returns.steps > 1)
    end, steps = returns.following[begin], returns.steps[begin]
    is_surface = _is_one_surface(returns.values[begin], returns.values[end], config)
    # From here on one element for each cell between two returns.
    between = steps - 1
    gap = np.repeat(np.arange(len(begin)), between)
    step = np.arange(1, len(gap) + 1) - (between.cumsum() - between)[gap]
    begin, end, steps, is_surface = begin[gap], end[gap], steps[gap], is_surface[gap]
    share = step / steps
    is_behind = share >= 0.5
    weight = np.where(is_surface, share, is_behind).astype(np.float32)
    first = returns.values[begin]
    rows = np.where(is_behind, returns.cells[end] - steps * grid.rows, returns.cells[begin])
    filled[rows + step * grid.rows] = first + weight * (returns.values[end] - first)


def _is_one_surface(first: Complex64, last: Complex64, config: ColumnFillingConfig) -> Bool:
    near, far = np.maximum(first.real, last.real), np.minimum(first.real, last.real)
    return np.asarray(near <= config.max_depth_ratio * far)
