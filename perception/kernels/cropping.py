"""Rows of a scan by place: those in or out of a rectangle, in a view, and on or above the ground."""

import numpy as np

from perception.kernels.compiled import NUMBER, array_of, compiled
from perception.types import Bool, Float32, Float64, Int

# Lowest and highest x, lowest and highest y.
Rectangle = tuple[float, float, float, float]

_POINTS, _ROWS = array_of(np.float32, 2), array_of(np.int64)
_NO_DEPTH_M = 1e-6  # up to which a point is behind the camera, as in `geometry.camera`


@compiled((_POINTS, (np.float32, np.float32, np.float32, np.float32), np.bool_))
def crop(points: Float32, rectangle: Rectangle, is_inside: bool) -> tuple[Int, Float32]:
    """Return the rows of (N, 3+) points that lie strictly inside a rectangle, or of all others, and these points."""
    low_x, high_x, low_y, high_y = rectangle
    count, columns = points.shape
    rows, cropped = np.empty(count + 1, np.int64), np.empty((count + 1, columns), np.float32)
    found = 0
    for row in range(count):
        x, y = points[row, 0], points[row, 1]
        is_in = (x > low_x) & (x < high_x) & (y > low_y) & (y < high_y)
        # Written in any case: a branch would often be foreseen wrongly.
        rows[found] = row
        cropped[found, 0], cropped[found, 1], cropped[found, 2] = x, y, points[row, 2]
        for column in range(3, columns):
            cropped[found, column] = points[row, column]
        found += int(is_in == is_inside)
    return rows[:found], cropped[:found]


@compiled((_POINTS, array_of(np.float32, 2)))
def rows_within_planes(points: Float32, planes: Float32) -> Int:
    """Return the rows of (N, 3+) points that are on the inner sides of all four planes; never of those at the origin.

    Args:
        points: (N, 3+) points.
        planes: (4, 4) normal and offset of each plane: a x + b y + c z + d > 0 on the inner side.
    """
    rows, found = np.empty(len(points), np.int64), 0
    for row in range(len(points)):
        x, y, z = points[row, 0], points[row, 1], points[row, 2]
        is_inner = (x != 0) | (y != 0) | (z != 0)
        # Neighbours in a scan are on the same side of most planes: the branch is foreseen rightly.
        for plane in range(4):
            along = x * planes[plane, 0] + y * planes[plane, 1] + z * planes[plane, 2]
            if not along + planes[plane, 3] > 0:
                is_inner = False
                break
        if is_inner:
            rows[found] = row
            found += 1
    return rows[:found]


@compiled((_POINTS, _ROWS, array_of(np.float64, 2), array_of(np.bool_, 2), NUMBER))
def rows_within_mask(
    points: Float32, rows: Int, image_P_points: Float64, mask: Bool, max_depth_m: float
) -> tuple[Int, Float64, Float64, Float64]:
    """Return those of some rows of (N, 3+) points that are projected onto a mask, in front of the camera.

    Args:
        points: (N, 3+) points.
        rows: (M,) rows of the points that count.
        image_P_points: (3, 4) projection to pixels.
        mask: (H, W) mask; beyond a border a point counts as on it.
        max_depth_m: Largest depth.

    Returns:
        (K,) rows, (K, 3) points, (2, K) columns and rows of the image, and (K,) depths.
    """
    P, last_row, last_column = image_P_points, mask.shape[0] - 1.0, mask.shape[1] - 1.0
    kept, found = np.empty(len(rows), np.int64), 0
    xyz, pixels, depths_m = np.empty((len(rows), 3)), np.empty((2, len(rows))), np.empty(len(rows))
    for row in rows:
        x, y, z = np.float64(points[row, 0]), np.float64(points[row, 1]), np.float64(points[row, 2])
        depth_m = P[2, 0] * x + P[2, 1] * y + P[2, 2] * z + P[2, 3]
        if not (depth_m > _NO_DEPTH_M and depth_m <= max_depth_m):
            continue
        u = (P[0, 0] * x + P[0, 1] * y + P[0, 2] * z + P[0, 3]) / depth_m
        v = (P[1, 0] * x + P[1, 1] * y + P[1, 2] * z + P[1, 3]) / depth_m
        if mask[int(min(max(v, 0.0), last_row)), int(min(max(u, 0.0), last_column))]:
            xyz[found, 0], xyz[found, 1], xyz[found, 2] = x, y, z
            kept[found], depths_m[found], pixels[0, found], pixels[1, found] = row, depth_m, u, v
            found += 1
    return kept[:found], xyz[:found], pixels[:, :found], depths_m[:found]


@compiled((_POINTS, _ROWS, array_of(np.float32), NUMBER, NUMBER))
def split_by_height(
    points: Float32, rows: Int, above_m: Float32, low_m: float, high_m: float
) -> tuple[Float32, Int, Int]:
    """Split (M, 3+) points by their distance above the ground.

    Args:
        points: (M, 3+) points.
        rows: (M,) their rows in the scan.
        above_m: (M,) their distances above the ground in metres.
        low_m: Smallest distance of an obstacle point.
        high_m: Largest distance of an obstacle point, exclusive.

    Returns:
        (O, 3) obstacle points, their rows, and the rows of the ground points.
    """
    low, high = np.float32(low_m), np.float32(high_m)
    chosen, ground = np.empty(len(points) + 1, np.int64), np.empty(len(points) + 1, np.int64)
    obstacles, grounds = 0, 0
    for at in range(len(points)):
        chosen[obstacles], ground[grounds] = at, rows[at]
        obstacles += int((above_m[at] >= low) & (above_m[at] < high))
        grounds += int(above_m[at] < low)
    obstacle_points, obstacle_rows = np.empty((obstacles, 3), np.float32), chosen[:obstacles]
    for number in range(obstacles):
        at = obstacle_rows[number]
        for axis in range(3):
            obstacle_points[number, axis] = points[at, axis]
        obstacle_rows[number] = rows[at]
    return obstacle_points, obstacle_rows, ground[:grounds]
