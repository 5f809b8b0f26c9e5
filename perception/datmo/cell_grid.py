"""Square cells over an area around the vehicle.

   x ^  row X-1        Cell (i, j) holds x from low_x + i cell_m and y from low_y + j cell_m on.
     |   ...           In cell coordinates the middle of cell (i, j) is (i + 0.5, j + 0.5).
     |  row 0
y <--+
"""

from dataclasses import dataclass

import numpy as np

from perception.geometry.grids import LocalArea
from perception.types import Float64, Int


@dataclass(frozen=True)
class CellGrid:
    """Position of the cells in the LiDAR frame.

    Attributes:
        low_m: (x, y) of the corner with the smallest coordinates.
        shape: (X, Y) number of cells.
        cell_m: Edge of a cell in metres (υ).
    """

    low_m: tuple[float, float]
    shape: tuple[int, int]
    cell_m: float

    @classmethod
    def covering(cls, area: LocalArea, cell_m: float) -> "CellGrid":
        """Return cells from the area's rear right corner to at least its front left one."""
        lengths_m = area.behind_m + area.ahead_m, 2 * area.side_m
        rows, columns = (int(np.ceil(length_m / cell_m - 1e-6)) for length_m in lengths_m)
        return cls((-area.behind_m, -area.side_m), (rows, columns), cell_m)

    @property
    def high_m(self) -> tuple[float, float]:
        """(x, y) of the corner with the largest coordinates."""
        low_x, low_y = self.low_m
        return low_x + self.shape[0] * self.cell_m, low_y + self.shape[1] * self.cell_m

    @property
    def cells_T_velo(self) -> Float64:
        """(3, 3) from homogeneous x, y in the LiDAR frame to cell coordinates."""
        x, y = self.low_m
        return np.array([[1, 0, -x], [0, 1, -y], [0, 0, self.cell_m]]) / self.cell_m

    def centers_m(self, rows: Int, columns: Int) -> Float64:
        """Return (C, 2) x and y of the middles of C cells."""
        cells = np.column_stack([rows, columns]).astype(np.float64)
        return np.asarray((cells + 0.5) * self.cell_m + np.array(self.low_m))

    def part(self, area: LocalArea) -> tuple[slice, slice]:
        """Return the rows and columns of the cells over a smaller area."""
        inner = CellGrid.covering(area, self.cell_m)
        starts = [round((inner.low_m[k] - self.low_m[k]) / self.cell_m) for k in (0, 1)]
        rows, columns = (
            slice(start, start + length) for start, length in zip(starts, inner.shape, strict=True)
        )
        return rows, columns
