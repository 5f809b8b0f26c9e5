"""Sum of a map at projected points, and its slopes by a change of the calibration."""

import numpy as np

from perception.kernels.compiled import NUMBER, array_of, compiled, written
from perception.types import Float32, Float64

_MAP, _ROWS = array_of(np.float32, 2), array_of(np.float64, 2)


@compiled((_MAP, NUMBER, NUMBER))
def sample_map(edges: Float32, u: float, v: float) -> tuple[float, float, float]:
    """Return the value between four pixels of a map, and its slopes along columns and rows.

    A place outside its map takes the value at the border, without a slope across it.

    Args:
        edges: (H, W) map, H and W at least 2.
        u: Column in pixels; NaN is taken for a place outside.
        v: Row in pixels.
    """
    last_row, last_column = edges.shape[0] - 1, edges.shape[1] - 1
    is_beside = u >= 0 and u <= last_column
    is_between = v >= 0 and v <= last_row
    # The comparisons are false with NaN.
    u = min(u, np.float64(last_column)) if u > 0 else np.float64(0)
    v = min(v, np.float64(last_row)) if v > 0 else np.float64(0)
    j, i = min(int(u), last_column - 1), min(int(v), last_row - 1)
    right, down = u - j, v - i
    top_left, top_right = np.float64(edges[i, j]), np.float64(edges[i, j + 1])
    low_left, low_right = np.float64(edges[i + 1, j]), np.float64(edges[i + 1, j + 1])
    top = top_left + right * (top_right - top_left)
    low = low_left + right * (low_right - low_left)
    along_top, along_low = top_right - top_left, low_right - low_left
    along_u = along_top + down * (along_low - along_top) if is_beside else 0.0
    along_v = low - top if is_between else 0.0
    return top + down * (low - top), along_u, along_v


@compiled((_MAP, _ROWS, _ROWS, _ROWS, NUMBER, written(np.float64)))
def add_map_sums(
    edges: Float32,
    map_P_cam: Float64,
    points_cam: Float64,
    moved_SE3_cam: Float64,
    min_depth_m: float,
    sums: Float64,
) -> None:
    """Add up the values of a map at projected points, and their slopes by a small motion of all points.

    Args:
        edges: (H, W) map, H and W at least 2.
        map_P_cam: (3, 4) projection to its pixels.
        points_cam: (K, 3) points in the camera's frame.
        moved_SE3_cam: (4, 4) change of the points before they are projected.
        min_depth_m: Depth in metres from which on a point is in view; a nearer one has the value of the first pixel.
        sums: (7,) that are added to: value, slopes by a rotation vector after the change's rotation and before its
            translation, slopes by a translation.
    """
    M, P = moved_SE3_cam, map_P_cam
    total, wx, wy, wz, tx, ty, tz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(len(points_cam)):
        a, b, c = points_cam[k, 0], points_cam[k, 1], points_cam[k, 2]
        rx = M[0, 0] * a + M[0, 1] * b + M[0, 2] * c
        ry = M[1, 0] * a + M[1, 1] * b + M[1, 2] * c
        rz = M[2, 0] * a + M[2, 1] * b + M[2, 2] * c
        x, y, z = rx + M[0, 3], ry + M[1, 3], rz + M[2, 3]
        depth_m = P[2, 0] * x + P[2, 1] * y + P[2, 2] * z + P[2, 3]
        if not depth_m > min_depth_m:
            total += sample_map(edges, np.nan, np.nan)[0]
            continue
        per_depth = 1 / depth_m
        u = (P[0, 0] * x + P[0, 1] * y + P[0, 2] * z + P[0, 3]) * per_depth
        v = (P[1, 0] * x + P[1, 1] * y + P[1, 2] * z + P[1, 3]) * per_depth
        value, along_u, along_v = sample_map(edges, u, v)
        # Slopes in the map, along the homogeneous pixel, along the point, along the change.
        along_u, along_v = along_u * per_depth, along_v * per_depth
        along_w = -along_u * u - along_v * v
        gx = along_u * P[0, 0] + along_v * P[1, 0] + along_w * P[2, 0]
        gy = along_u * P[0, 1] + along_v * P[1, 1] + along_w * P[2, 1]
        gz = along_u * P[0, 2] + along_v * P[1, 2] + along_w * P[2, 2]
        total += value
        wx, wy, wz = wx + ry * gz - rz * gy, wy + rz * gx - rx * gz, wz + rx * gy - ry * gx
        tx, ty, tz = tx + gx, ty + gy, tz + gz
    sums[0] += total
    sums[1], sums[2], sums[3] = sums[1] + wx, sums[2] + wy, sums[3] + wz
    sums[4], sums[5], sums[6] = sums[4] + tx, sums[5] + ty, sums[6] + tz
