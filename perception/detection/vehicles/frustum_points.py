"""Points above the ground within the frustums of boxes in the image, and the height of the ground there."""

from dataclasses import dataclass

import numpy as np

from perception.detection.height_cells import HeightCells
from perception.kernels.cropping import rows_within_mask
from perception.maps.projection import rows_near_view
from perception.types import Bool, Calibration, Float32, Float64, GroundModel, Int

_BORDER_EXTENSION = 3.0  # of a box that the image's border cuts, in its heights: the LiDAR sees on
_GROUND_CELL_M = 0.5  # edge of the cells of the lowest points
_GROUND_SEARCH_RADIUS_M = 1.5  # distance within which some ground is observed, beside a car
_GROUND_STEP_M = 0.2  # maximum height of ground above the lowest point within that distance
_CLEARANCE_M = 0.2  # minimum height above the ground of a vehicle's points
_MODEL_ERROR_M = 0.3  # maximum difference between the ground around and a ground model that is used
_MODEL_REACH_M = 30.0  # maximum distance from the LiDAR at which the ground model is used


@dataclass(frozen=True)
class FrustumPoints:
    """K points of a scan above the ground and around boxes in the image.

    Attributes:
        rows: (K,) rows of the points in the scan.
        xyz_m: (K, 3) positions in the LiDAR frame.
        pixels: (K, 2) column and row.
        depths_m: (K,) depths along the optical axis.
        ground_m: (K,) z of the ground below.
        above_m: (K,) heights above the ground, of the model or of the points around, whichever is higher.
    """

    rows: Int
    xyz_m: Float64
    pixels: Float64
    depths_m: Float64
    ground_m: Float64
    above_m: Float64


def find_frustum_points(
    points_velo: Float32,
    boxes_px: Float64,
    camera: tuple[Calibration, tuple[int, int]],
    ground: GroundModel | None,
    max_depth_m: float,
) -> FrustumPoints:
    """Return the points above the ground within boxes in the image, and the height of the ground there.

    Args:
        points_velo: (N, 4) points of the scan.
        boxes_px: (M, 4) boxes, within the image or beyond its borders.
        camera: Calibration, and (width, height) of the image.
        ground: Ground model; None takes the lowest points of the cells around.
        max_depth_m: Maximum depth of a point along the optical axis.
    """
    around_px = _with_ground_before(boxes_px, camera[1])
    low_px, size_px = _window(around_px)
    # Pixels are counted from the corner of the window around all boxes, so that points outside drop out at once.
    shift = np.array([[1, 0, -low_px[0]], [0, 1, -low_px[1]], [0, 0, 1]])
    window_P_velo = shift @ camera[0].image_P_velo
    rows = rows_near_view(points_velo, window_P_velo, size_px)
    rows, xyz_m, (u, v), depths_m = rows_within_mask(
        np.ascontiguousarray(points_velo),
        rows,
        window_P_velo,
        _mask_around(around_px - np.tile(low_px, 2), size_px),
        max_depth_m,
    )
    cells = HeightCells.of(xyz_m, _GROUND_CELL_M)
    around_m = cells.ground_around_m(_GROUND_SEARCH_RADIUS_M, _GROUND_STEP_M)
    ground_m = around_m
    if ground is not None and len(rows):
        model_m = ground.height_m(xyz_m[:, :2])
        # A model extends beyond the points it was fitted to, but is not valid there.
        is_near = np.hypot(xyz_m[:, 0], xyz_m[:, 1]) <= _MODEL_REACH_M
        holds = is_near & (np.abs(model_m - around_m) < _MODEL_ERROR_M)
        ground_m = np.where(holds, model_m, around_m)
    above_m = xyz_m[:, 2] - np.maximum(ground_m, around_m)
    kept = np.flatnonzero(above_m >= _CLEARANCE_M)
    return FrustumPoints(
        rows[kept],
        xyz_m.take(kept, axis=0),
        np.stack([u[kept] + low_px[0], v[kept] + low_px[1]]).T,
        depths_m[kept],
        ground_m[kept],
        above_m[kept],
    )


def extend_beyond_borders(boxes_px: Float64, width_px: int) -> Float64:
    """Return (M, 4) boxes; those that a side of the image cuts are extended beyond it."""
    x1, y1, x2, y2 = np.clip(boxes_px.T, -width_px, 2 * width_px)
    reach_px = _BORDER_EXTENSION * (y2 - y1)
    return np.column_stack(
        [
            np.where(x1 <= 1, x1 - reach_px, x1),
            y1,
            np.where(x2 >= width_px - 2, x2 + reach_px, x2),
            y2,
        ]
    )


def _with_ground_before(boxes_px: Float64, size_px: tuple[int, int]) -> Float64:
    """Return (M, 4) boxes, extended downwards to the visible ground in front of a vehicle."""
    x1, y1, x2, y2 = boxes_px.T
    last_px = size_px[1] - 1
    lowest_px = np.clip(y2 + (y2 - y1) / 3, 0, last_px)
    return np.column_stack([x1, np.clip(y1, 0, last_px), x2, lowest_px])


def _window(boxes_px: Float64) -> tuple[Float64, tuple[int, int]]:
    """Return the upper left pixel, and (width, height), of the window around all boxes."""
    low_px = np.floor(boxes_px[:, :2].min(axis=0))
    width, height = (np.ceil(boxes_px[:, 2:].max(axis=0)) - low_px).astype(int) + 1
    return low_px, (max(int(width), 1), max(int(height), 1))


def _mask_around(boxes_px: Float64, size_px: tuple[int, int]) -> Bool:
    """Return the mask of the pixels of a window that lie in a box, with a pixel around them."""
    width, height = size_px
    is_near = np.zeros((height + 1, width + 1), bool)
    for x1, y1, x2, y2 in np.maximum(boxes_px, 0).astype(np.int64).tolist():
        is_near[y1 : y2 + 2, x1 : x2 + 2] = True
    return is_near
