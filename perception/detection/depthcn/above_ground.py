"""Points of a scan above the ground, in the camera's view (6.1.2).

The thesis keeps all points of a cell whose heights vary, with the ground at the foot of an obstacle. The default
decides by points: a point is above ground if it is clearly above the lowest point around, which also keeps
obstacles with few returns. It drops points that are higher than a vehicle, such as the crown of a tree, which
would connect all vehicles parked under it.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from perception.detection.height_cells import HeightCells
from perception.geometry.camera import project
from perception.maps.projection import rows_near_view
from perception.types import SHARED, ArrayTable, Bool, Calibration, Float32, Float64, Int, Method

_FARTHEST_M = 80.0  # range of the maps, ahead and to each side
_NEAREST_M = 0.5  # nearer points are on the recording vehicle
_THESIS_NEAREST_M = 5.0  # the author's code
_MIN_DENSITY = np.finfo(np.float64).eps  # the author's code
_DEVIATIONS = 3.0  # above the lowest point around, up to which a point is ground
_HIGHEST_M = 2.0  # above ground: the roofs of cars
_REACH_M = 1.5  # beside a car, some ground is visible within this distance


@dataclass(frozen=True)
class AboveGroundPoints(ArrayTable):
    """K points of a scan above the ground, in the camera's view.

    Attributes:
        rows: (K,) rows of the points in the scan.
        xy_m: (K, 2) positions in the LiDAR frame in metres.
        pixels: (K, 2) image column and row of each point.
        ground_rows_px: (K,) image row of the ground below each point; of the point itself where unknown.
        depths_m: (K,) depths along the optical axis in metres.
        size_px: (width, height) of the image.
        scan_length: Number of points of the scan, N.
    """

    rows: Int
    xy_m: Annotated[Float64, 2]
    pixels: Annotated[Float64, 2]
    ground_rows_px: Float64
    depths_m: Float64
    size_px: Annotated[tuple[int, int], SHARED]
    scan_length: Annotated[int, SHARED]


@dataclass(frozen=True)
class _GroundRemoval:
    """Rows of the points above ground, and the height of the ground below each."""

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
    """Find the points of a scan that can belong to a proposal.

    Args:
        points_velo: (N, 4) scan in the LiDAR frame.
        calibration: Calibration of the camera.
        size_px: (width, height) of the image.
        cell_m: Edge of a cell in metres.
        min_variance_m2: Minimum variance of the heights in a cell above flat ground, in square metres.
        method: Method of the ground removal.
    """
    image_P_velo = calibration.image_P_velo
    if method == "thesis":
        in_area = _ahead(points_velo)
    else:
        in_area = _near_in_view(points_velo, image_P_velo, size_px)
    points = points_velo.take(in_area, axis=0)
    remove = _in_cells_of_high_variance if method == "thesis" else _above_lowest
    removal = remove(points, cell_m, min_variance_m2)
    points = points.take(removal.rows, axis=0)[:, :3]
    exact_px, depths_m = project(image_P_velo, points)
    ground_points = np.column_stack([points[:, :2], removal.ground_m])
    ground_rows_px = np.rint(project(image_P_velo, ground_points)[0][:, 1])
    with np.errstate(invalid="ignore"):
        pixels = np.rint(exact_px)
        u, v = pixels.T
        is_in_view = (u >= 0) & (v >= 0) & (u < size_px[0]) & (v < size_px[1])
    visible = np.flatnonzero(is_in_view & (depths_m > _NEAREST_M))
    return AboveGroundPoints(
        rows=in_area[removal.rows[visible]],
        xy_m=points[visible, :2].astype(np.float64),
        pixels=pixels[visible],
        ground_rows_px=np.fmax(ground_rows_px[visible], pixels[visible, 1]),
        depths_m=depths_m[visible],
        size_px=size_px,
        scan_length=len(points_velo),
    )


def _near_in_view(points_velo: Float32, image_P_velo: Float64, size_px: tuple[int, int]) -> Int:
    rows = rows_near_view(points_velo, image_P_velo, size_px)
    x, y = points_velo[rows, 0], points_velo[rows, 1]
    return np.asarray(rows[np.maximum(np.abs(x), np.abs(y)) <= _FARTHEST_M])


def _ahead(points_velo: Float32) -> Int:
    x, y = points_velo[:, 0], points_velo[:, 1]
    is_ahead = (x >= _THESIS_NEAREST_M) & (x <= _FARTHEST_M) & (np.abs(y) <= _FARTHEST_M)
    return np.flatnonzero(is_ahead)


def _above_lowest(points: Float32, cell_m: float, min_variance_m2: float) -> _GroundRemoval:
    cells = HeightCells.of(points, cell_m)
    ground_m = cells.lowest_around_m(_REACH_M)
    above_m = cells.z_m - ground_m
    min_m = _DEVIATIONS * np.sqrt(min_variance_m2)
    rows = np.flatnonzero((above_m >= min_m) & (above_m <= _HIGHEST_M))
    return _GroundRemoval(rows, ground_m[rows])


def _in_cells_of_high_variance(
    points: Float32, cell_m: float, min_variance_m2: float
) -> _GroundRemoval:
    """Remove outliers, then flat cells, as the author's code does."""
    typical = np.flatnonzero(_is_typical(points))
    has_variance = HeightCells.of(points[typical], cell_m).has_variance(min_variance_m2)
    rows = typical[has_variance]
    return _GroundRemoval(rows, points[rows, 2].astype(np.float64))


def _is_typical(points: Float32) -> Bool:
    """Return the (N,) mask of the points that are likely under a normal distribution along each axis."""
    if len(points) == 0:
        return np.zeros(0, bool)
    xyz = points[:, :3].astype(np.float64)
    offsets, deviations = xyz - xyz.mean(axis=0), xyz.std(axis=0)
    if not deviations.all():
        return np.ones(len(points), bool)  # all points in a plane: no density
    log_density = -((offsets / deviations) ** 2).sum(axis=1) / 2
    log_density -= np.log((2 * np.pi) ** 1.5 * deviations.prod())
    return np.asarray(log_density > np.log(_MIN_DENSITY))
