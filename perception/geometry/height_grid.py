"""A smooth surface over a grid of heights, and the fit of one to scattered samples.

y ^   n3 ---- n4         Heights live at the nodes, numbered along y first. Between them the
  |   |   .   |          surface is bilinear: z = a + b u + c v + d u v with u, v in 0..1 across
  |   n1 ---- n2         the cell.
  +-------------> x
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Annotated, cast

import numpy as np
from scipy import sparse
from scipy.linalg.lapack import dpbsv

from perception.kernels.heights import (
    GridNumbers,
    add_normal_equations,
    distances_from_surface,
    interpolated,
)
from perception.types import ArrayTable, Float, Float64, Int


@dataclass(frozen=True)
class HeightSamples(ArrayTable):
    """Scattered heights.

    Attributes:
        points: (N, 3).
        weights: (N,) 1 for a height that is as certain as any.
    """

    points: Annotated[Float64, 3]
    weights: Float64


@dataclass(frozen=True)
class BilinearWeights:
    """Positions of N points between the nodes.

    Attributes:
        nodes: (4, N) the four nodes around each.
        weights: (4, N) their shares of the height.
    """

    nodes: Int
    weights: Float64

    def interpolate(self, heights_m: Float64) -> Float64:
        """Return (N,) heights of the surface."""
        return interpolated(self.nodes, self.weights, heights_m)


@dataclass(frozen=True)
class HeightGrid:
    """Grid of nodes with heights.

    Attributes:
        x0_m: Coordinate x of the first node in metres.
        y0_m: Coordinate y of the first node in metres.
        cell_m: Distance between two nodes in metres.
        nodes_x: Number of nodes along x.
        nodes_y: Number of nodes along y.
    """

    x0_m: float
    y0_m: float
    cell_m: float
    nodes_x: int
    nodes_y: int

    @classmethod
    def covering(
        cls, low_m: tuple[float, float], high_m: tuple[float, float], cell_m: float
    ) -> "HeightGrid":
        """Lay nodes from a low corner (x, y) to at least a high one."""
        cells = [int(np.ceil((high_m[k] - low_m[k]) / cell_m - 1e-9)) for k in (0, 1)]
        return cls(low_m[0], low_m[1], cell_m, cells[0] + 1, cells[1] + 1)

    @property
    def size(self) -> int:
        """Number of nodes."""
        return self.nodes_x * self.nodes_y

    @property
    def numbers(self) -> GridNumbers:
        """The grid as compiled functions take it."""
        return self.x0_m, self.y0_m, self.cell_m, self.nodes_x, self.nodes_y

    @cached_property
    def nodes_xy_m(self) -> Float64:
        """(size, 2) positions of the nodes."""
        x = self.x0_m + self.cell_m * np.arange(self.nodes_x)
        y = self.y0_m + self.cell_m * np.arange(self.nodes_y)
        return np.column_stack([np.repeat(x, self.nodes_y), np.tile(y, self.nodes_x)])

    def bilinear(self, xy_m: Float64) -> BilinearWeights:
        """Return the nodes around (N, 2+) positions; outside the grid the outermost cell is extrapolated."""
        u = (xy_m[:, 0] - self.x0_m) / self.cell_m
        v = (xy_m[:, 1] - self.y0_m) / self.cell_m
        i = np.clip(np.floor(u).astype(np.int64), 0, self.nodes_x - 2)
        j = np.clip(np.floor(v).astype(np.int64), 0, self.nodes_y - 2)
        first = i * self.nodes_y + j
        u, v = u - i, v - j
        return BilinearWeights(
            nodes=first + np.array([[0], [1], [self.nodes_y], [self.nodes_y + 1]]),
            weights=np.stack([(1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v]),
        )

    def fit(
        self,
        samples: HeightSamples,
        stiffness: float,
        prior_m: Float64,
        scales_m: tuple[float, float] = (np.inf, np.inf),
    ) -> Float64:
        """Return (size,) heights that minimise squared misfits + stiffness x roughness.

        Args:
            samples: Heights that the surface is fitted to.
            stiffness: Weight of the squared second differences between nodes.
            prior_m: (size,) heights from which residuals are taken, and which are used, with next to no weight, where
                nothing else determines the surface.
            scales_m: Scales in metres of the robust weights of residuals below and above; infinite for equal weights.
        """
        banded = stiffness * _roughness(self.nodes_x, self.nodes_y)
        banded[:, -1] += _PRIOR_WEIGHT
        right = _PRIOR_WEIGHT * prior_m
        right += add_normal_equations(
            samples.points, samples.weights, prior_m, scales_m, self.numbers, banded
        )
        # Without the checks and copies of scipy.linalg: the matrix is positive definite by the prior.
        _, heights_m, _ = dpbsv(banded.T, right, overwrite_ab=True, overwrite_b=True)
        return np.asarray(heights_m)


@dataclass(frozen=True)
class HeightSurface:
    """A bilinear surface: the `GroundModel` of the default ground.

    Attributes:
        grid: Nodes of the surface.
        heights_m: (grid.size,) z at the nodes.
    """

    grid: HeightGrid
    heights_m: Float64

    def height_m(self, xy_m: Float) -> Float64:
        """Return (N,) the z of the ground at (N, 2) positions."""
        return self.grid.bilinear(np.asarray(xy_m, np.float64)).interpolate(self.heights_m)

    def distance_m(self, points_velo: Float) -> Float:
        """Return (N,) signed distances of (N, 3+) points from the surface, along its cell's normal."""
        points = cast(Float, np.ascontiguousarray(points_velo))
        return distances_from_surface(points, self.heights_m, self.grid.numbers)


_PRIOR_WEIGHT = 1e-3  # against the 1 of a sample


# Cached here and not in the grids, which are sent from one process to another with every frame.
@lru_cache(maxsize=16)
def _roughness(nodes_x: int, nodes_y: int) -> Float64:
    """Return the matrix of the sum of squared second differences, the transpose of LAPACK's upper banded form."""
    along_x, along_y = sparse.identity(nodes_x), sparse.identity(nodes_y)
    differences = sparse.vstack(
        [
            sparse.kron(_differences(nodes_x, 2), along_y),
            sparse.kron(along_x, _differences(nodes_y, 2)),
            np.sqrt(2) * sparse.kron(_differences(nodes_x, 1), _differences(nodes_y, 1)),
        ]
    )
    product = sparse.triu(differences.T @ differences).tocoo()
    bandwidth = 2 * nodes_y
    banded = np.zeros((nodes_x * nodes_y, bandwidth + 1))
    banded[product.col, bandwidth + product.row - product.col] = product.data
    return banded


def _differences(nodes: int, order: int) -> sparse.spmatrix:
    stencil = {1: [-1.0, 1.0], 2: [1.0, -2.0, 1.0]}[order]
    return sparse.diags(stencil, range(order + 1), shape=(nodes - order, nodes))
