"""Which points of a scan stand on the ground, in the camera's view (6.1.2).

The thesis keeps all points of a cell in which heights vary, so that the ground at the foot of an obstacle
stays with it. The default looks at points, not cells: a point stands if it is well over the lowest one
around, which also finds what few beams hit; and it passes over what is higher than a vehicle, such as the
crown of a tree that would tie together all that is parked under it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from perception.detection.height_cells import HeightCells
from perception.geometry.camera import project
from perception.maps.projection import may_be_in_view
from perception.types import Bool, Calibration, Float32, Float64, Int, Method

_FARTHEST_M = 80.0  # as in the maps, ahead and to each side
_NEAREST_M = 0.5  # what is nearer is the vehicle itself
_THESIS_NEAREST_M = 5.0  # the author's code
_MIN_DENSITY = np.finfo(np.float64).eps  # the author's code
_DEVIATIONS = 3.0  # over the lowest point around, of what passes for ground
_HIGHEST_M = 2.0  # over the ground: the roofs of cars
_REACH_M = 1.5  # under a car, some ground is seen from one side or the other


@dataclass(frozen=True)
class AboveGroundPoints:
    """K points of a scan that stand on the ground and that the camera sees.

    Attributes:
        rows: (K,) where they are in the scan.
        xy_m: (K, 2) in the LiDAR frame.
        pixels: (K, 2) the column and row of each.
        ground_rows_px: (K,) the image row of the ground under each; its own where that is not known.
        depths_m: (K,) along the optical axis.
        size_px: (width, height) of the image.
        scan_length: N.
    """

    rows: Int
    xy_m: Float64
    pixels: Float64
    ground_rows_px: Float64
    depths_m: Float64
    size_px: tuple[int, int]
    scan_length: int

    def __len__(self) -> int:
        """Return K."""
        return len(self.rows)


@dataclass(frozen=True)
class _GroundRemoval:
    """Rows of a scan that stand on the ground, and the height of the ground under each."""

    rows: Int
    ground_m: Float64


def find_above_ground(
    points_velo: Float32,
    calibration: Calibration,
    size_px: tuple[int, int],
    cell_m: float,
    min_variance_m2: float,
    method: Method = "default",
) -> AboveGroundPoints:
    """Find the points of an (N, 4) scan that can belong to a candidate.

    Args:
        points_velo: the scan.
        calibration: of the camera.
        size_px: (width, height) of its image.
        cell_m: edge of a cell.
        min_variance_m2: of heights that are not those of flat ground.
        method: default or thesis.
    """
    image_P_velo = calibration.image_P_velo
    candidates = _AREA_FILTERS[method](points_velo, image_P_velo, size_px)
    chosen = _GROUND_REMOVALS[method](points_velo[candidates], cell_m, min_variance_m2)
    points = points_velo[candidates[chosen.rows], :3]
    exact_px, depths_m = project(image_P_velo, points)
    ground_points = np.column_stack([points[:, :2], chosen.ground_m])
    ground_rows_px = np.rint(project(image_P_velo, ground_points)[0][:, 1])
    with np.errstate(invalid="ignore"):
        pixels = np.rint(exact_px)
        u, v = pixels.T
        is_observed = (u >= 0) & (v >= 0) & (u < size_px[0]) & (v < size_px[1])
    seen = np.flatnonzero(is_observed & (depths_m > _NEAREST_M))
    return AboveGroundPoints(
        rows=candidates[chosen.rows[seen]],
        xy_m=points[seen, :2].astype(np.float64),
        pixels=pixels[seen],
        ground_rows_px=np.fmax(ground_rows_px[seen], pixels[seen, 1]),
        depths_m=depths_m[seen],
        size_px=size_px,
        scan_length=len(points_velo),
    )


def _near_in_view(points_velo: Float32, image_P_velo: Float64, size_px: tuple[int, int]) -> Int:
    rows = np.flatnonzero(may_be_in_view(points_velo, image_P_velo, size_px))
    x, y = points_velo[rows, 0], points_velo[rows, 1]
    return np.asarray(rows[np.maximum(np.abs(x), np.abs(y)) <= _FARTHEST_M])


def _ahead(points_velo: Float32, _: Float64, __: tuple[int, int]) -> Int:
    x, y = points_velo[:, 0], points_velo[:, 1]
    is_ahead = (x >= _THESIS_NEAREST_M) & (x <= _FARTHEST_M) & (np.abs(y) <= _FARTHEST_M)
    return np.flatnonzero(is_ahead)


def _above_lowest(points: Float32, cell_m: float, min_variance_m2: float) -> _GroundRemoval:
    cells = HeightCells.of(points, cell_m)
    ground_m = cells.lowest_around_m(_REACH_M)
    over_m = cells.z_m - ground_m
    min_m = _DEVIATIONS * np.sqrt(min_variance_m2)
    rows = np.flatnonzero((over_m >= min_m) & (over_m <= _HIGHEST_M))
    return _GroundRemoval(rows, ground_m[rows])


def _in_cells_of_high_variance(
    points: Float32, cell_m: float, min_variance_m2: float
) -> _GroundRemoval:
    """Cut off outliers, then flat cells, as the author's code does."""
    typical = np.flatnonzero(_is_typical(points))
    has_variance = HeightCells.of(points[typical], cell_m).has_variance(min_variance_m2)
    rows = typical[has_variance]
    return _GroundRemoval(rows, points[rows, 2].astype(np.float64))


def _is_typical(points: Float32) -> Bool:
    """Tell which (N, 3+) points are not improbable under one normal distribution along each axis."""
    if len(points) == 0:
        return np.zeros(0, bool)
    xyz = points[:, :3].astype(np.float64)
    offsets, deviations = xyz - xyz.mean(axis=0), xyz.std(axis=0)
    if not deviations.all():
        return np.ones(len(points), bool)  # flat or lined up: there is no density
    log_density = -((offsets / deviations) ** 2).sum(axis=1) / 2
    log_density -= np.log((2 * np.pi) ** 1.5 * deviations.prod())
    return np.asarray(log_density > np.log(_MIN_DENSITY))


_AREA_FILTERS: Mapping[Method, Callable[[Float32, Float64, tuple[int, int]], Int]] = {
    "default": _near_in_view,
    "thesis": _ahead,
}
_GROUND_REMOVALS: Mapping[Method, Callable[[Float32, float, float], _GroundRemoval]] = {
    "default": _above_lowest,
    "thesis": _in_cells_of_high_variance,
}
