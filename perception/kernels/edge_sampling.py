"""Sum of a map at projected points, and its slopes by a change of the calibration."""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled, written
from perception.types import Bool, Float32, Float64

_MAPS, _ROWS = array_of(np.float32, 3), array_of(np.float64, 2)


@compiled((_MAPS, WHOLE, NUMBER, NUMBER))
def sample_map(maps: Float32, number: int, u: float, v: float) -> tuple[float, float, float]:
    """Return the value between four pixels of a map, and its slopes along columns and rows.

    A place outside its map takes the value at the border, without a slope across it.

    Args:
        maps: (M, H, W) maps, H and W at least 2.
        number: Number of the map.
        u: Column in pixels; NaN is taken for a place outside.
        v: Row in pixels.
    """
    last_row, last_column = maps.shape[1] - 1, maps.shape[2] - 1
    is_beside = u >= 0 and u <= last_column
    is_between = v >= 0 and v <= last_row
    # The comparisons are false with NaN.
    u = min(u, np.float64(last_column)) if u > 0 else np.float64(0)
    v = min(v, np.float64(last_row)) if v > 0 else np.float64(0)
    j, i = min(int(u), last_column - 1), min(int(v), last_row - 1)
    right, down = u - j, v - i
    n = number
    top_left, top_right = np.float64(maps[n, i, j]), np.float64(maps[n, i, j + 1])
    low_left, low_right = np.float64(maps[n, i + 1, j]), np.float64(maps[n, i + 1, j + 1])
    top = top_left + right * (top_right - top_left)
    low = low_left + right * (low_right - low_left)
    along_top, along_low = top_right - top_left, low_right - low_left
    along_u = along_top + down * (along_low - along_top) if is_beside else 0.0
    along_v = low - top if is_between else 0.0
    return top + down * (low - top), along_u, along_v


@compiled(
    (
        _MAPS, array_of(np.bool_), _ROWS, _ROWS, _ROWS, NUMBER, written(np.float64),
    )
)  # fmt: skip
def add_map_sums(
    maps: Float32,
    is_first: Bool,
    map_P_cam: Float64,
    points_cam: Float64,
    moved_SE3_cam: Float64,
    min_depth_m: float,
    sums: Float64,
) -> None:
    """Add up the values of maps at projected points, and their slopes by a small motion of all points.

    With the slopes d along the homogeneous pixels of points x, the slopes of the sum along the projection are those of all
    pairs, d (x, 1)^T: what the motion makes of them is the same for all points.

    Args:
        maps: (2, H, W) maps, H and W at least 2.
        is_first: (K,) whether a point belongs to the first map, else to the second.
        map_P_cam: (3, 4) projection to their pixels.
        points_cam: (K, 3) points in the camera's frame.
        moved_SE3_cam: (4, 4) change of the points before they are projected.
        min_depth_m: Depth in metres from which on a point is in view; a nearer one has the value of the first pixel.
        sums: (7,) that are added to: value, slopes by a rotation vector after the change's rotation and before its
            translation, slopes by a translation.
    """
    M, P = moved_SE3_cam, map_P_cam
    A = np.empty((3, 4))
    for i in range(3):
        for j in range(4):
            A[i, j] = P[i, 0] * M[0, j] + P[i, 1] * M[1, j] + P[i, 2] * M[2, j]
        A[i, 3] += P[i, 3]
    total = 0.0
    ux, uy, uz, u1, vx, vy, vz, v1, wx, wy, wz, w1 = np.zeros(12)
    for k in range(len(points_cam)):
        x, y, z = points_cam[k, 0], points_cam[k, 1], points_cam[k, 2]
        number = 0 if is_first[k] else 1
        depth_m = A[2, 0] * x + A[2, 1] * y + A[2, 2] * z + A[2, 3]
        if not depth_m > min_depth_m:
            total += maps[number, 0, 0]
            continue
        per_depth = 1 / depth_m
        u = (A[0, 0] * x + A[0, 1] * y + A[0, 2] * z + A[0, 3]) * per_depth
        v = (A[1, 0] * x + A[1, 1] * y + A[1, 2] * z + A[1, 3]) * per_depth
        value, along_u, along_v = sample_map(maps, number, u, v)
        along_u, along_v = along_u * per_depth, along_v * per_depth
        along_w = -along_u * u - along_v * v
        total += value
        ux, uy, uz, u1 = ux + along_u * x, uy + along_u * y, uz + along_u * z, u1 + along_u
        vx, vy, vz, v1 = vx + along_v * x, vy + along_v * y, vz + along_v * z, v1 + along_v
        wx, wy, wz, w1 = wx + along_w * x, wy + along_w * y, wz + along_w * z, w1 + along_w
    sums[0] += total
    # Slopes along the moved points times these, before their translation.
    pairs = np.empty((3, 3))
    for i in range(3):
        tx = P[0, i] * ux + P[1, i] * vx + P[2, i] * wx
        ty = P[0, i] * uy + P[1, i] * vy + P[2, i] * wy
        tz = P[0, i] * uz + P[1, i] * vz + P[2, i] * wz
        for j in range(3):
            pairs[i, j] = tx * M[j, 0] + ty * M[j, 1] + tz * M[j, 2]
        sums[4 + i] += P[0, i] * u1 + P[1, i] * v1 + P[2, i] * w1
    sums[1] += pairs[2, 1] - pairs[1, 2]
    sums[2] += pairs[0, 2] - pairs[2, 0]
    sums[3] += pairs[1, 0] - pairs[0, 1]
