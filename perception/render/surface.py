"""The ground surface, sampled for drawing."""

from dataclasses import dataclass

import numpy as np

from perception.geometry.grids import LocalArea
from perception.types import Float64, GroundModel


@dataclass(frozen=True)
class GroundMesh:
    """Heights of the ground on a regular grid over the local area.

    Attributes:
        x_m: (I,) positions ahead, rising.
        y_m: (J,) positions to the left, rising.
        height_m: (I, J) z of the ground.
    """

    x_m: Float64
    y_m: Float64
    height_m: Float64

    @property
    def nodes_m(self) -> Float64:
        """(I, J, 3) the grid's nodes in the LiDAR frame."""
        x, y = np.meshgrid(self.x_m, self.y_m, indexing="ij")
        return np.stack([x, y, self.height_m], axis=-1)

    def slope(self) -> tuple[Float64, Float64]:
        """Return the (I, J) rise per metre along x and along y."""
        along_x, along_y = np.gradient(self.height_m, self.x_m, self.y_m)
        return np.asarray(along_x), np.asarray(along_y)


def sample_surface(ground: GroundModel, area: LocalArea, step_m: float = 1.0) -> GroundMesh:
    """Sample the ground over the local area, its edges included, at most a step apart."""
    x_m = _ticks(-area.behind_m, area.ahead_m, step_m)
    y_m = _ticks(-area.side_m, area.side_m, step_m)
    x, y = np.meshgrid(x_m, y_m, indexing="ij")
    height_m = ground.height_m(np.column_stack([x.ravel(), y.ravel()]))
    return GroundMesh(x_m, y_m, np.asarray(height_m, np.float64).reshape(x.shape))


def _ticks(start_m: float, stop_m: float, step_m: float) -> Float64:
    return np.linspace(start_m, stop_m, int(np.ceil((stop_m - start_m) / step_m - 1e-9)) + 1)
