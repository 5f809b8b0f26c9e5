"""Normal equations of the calibration by corners: where they should be in a later image, and how that changes."""

import numpy as np

from perception.kernels.compiled import NUMBER, array_of, compiled, written
from perception.types import Float64

_ROWS, _LINE = array_of(np.float64, 2), array_of(np.float64)
UNKNOWNS = 13  # turn and shift of the calibration, sweep, turn and shift of the error of the motion


@compiled(
    (
        _ROWS, _ROWS, _ROWS, _LINE, _LINE, _ROWS, _ROWS, _ROWS, _LINE, NUMBER, NUMBER, NUMBER,
        written(np.float64, 2), written(np.float64),
    )
)  # fmt: skip
def add_corner_sums(
    planes_velo: Float64,
    rays: Float64,
    later_px: Float64,
    deviations_px: Float64,
    shifts_m: Float64,
    cam_SE3_velo: Float64,
    later_SE3_cam: Float64,
    image_P_cam: Float64,
    center_m: Float64,
    sweep: float,
    scale: float,
    max_inlier: float,
    curvature: Float64,
    slope: Float64,
) -> tuple[float, float]:
    """Add the corners of one frame to normal equations; return their robust cost and the share that is where it should be.

    With the ray r through a corner, its plane n . x = d and the motion M, all in the camera's frame, it comes to be at
    y = M x with x on the ray and on the plane. A change of the calibration by a turn w and a shift t moves x by
    r (n . t - w . (n x x)) / (n . r), and M by the same change before and after it.

    Args:
        planes_velo: (K, 4) planes in the LiDAR's frame; a corner whose plane is NaN costs as one that is elsewhere.
        rays: (K, 3) rays through the corners, in the camera's frame.
        later_px: (K, 2) where the later image shows them.
        deviations_px: (K,) standard deviations of these.
        shifts_m: (K,) how far planes move along their normals if the LiDAR turns counter-clockwise.
        cam_SE3_velo: (4, 4) calibration.
        later_SE3_cam: (4, 4) motion of the camera.
        image_P_cam: (3, 4) projection to pixels.
        center_m: (3,) centre of the camera, where the rays begin.
        sweep: Share of the sweep.
        scale: Deviations from which on a corner counts little (Geman-McClure).
        max_inlier: Deviations up to which a corner is where it should be.
        curvature: (13, 13) that is added to.
        slope: (13,) that is added to.
    """
    T, M, P = cam_SE3_velo, later_SE3_cam, image_P_cam
    cost, known, inliers = 0.0, 0, 0
    by_unknown = np.empty((3, UNKNOWNS))
    row_u, row_v = np.empty(UNKNOWNS), np.empty(UNKNOWNS)
    for k in range(len(rays)):
        a, b, c = planes_velo[k, 0], planes_velo[k, 1], planes_velo[k, 2]
        nx = T[0, 0] * a + T[0, 1] * b + T[0, 2] * c
        ny = T[1, 0] * a + T[1, 1] * b + T[1, 2] * c
        nz = T[2, 0] * a + T[2, 1] * b + T[2, 2] * c
        distance_m = planes_velo[k, 3] + nx * T[0, 3] + ny * T[1, 3] + nz * T[2, 3]
        distance_m += sweep * shifts_m[k]
        rx, ry, rz = rays[k, 0], rays[k, 1], rays[k, 2]
        along = nx * rx + ny * ry + nz * rz
        from_center_m = distance_m - (nx * center_m[0] + ny * center_m[1] + nz * center_m[2])
        reach = from_center_m / along if along != 0 else np.nan
        x, y, z = center_m[0] + reach * rx, center_m[1] + reach * ry, center_m[2] + reach * rz
        # Later point, and its motion with the plane's distance.
        lx = M[0, 0] * x + M[0, 1] * y + M[0, 2] * z + M[0, 3]
        ly = M[1, 0] * x + M[1, 1] * y + M[1, 2] * z + M[1, 3]
        lz = M[2, 0] * x + M[2, 1] * y + M[2, 2] * z + M[2, 3]
        depth_m = P[2, 0] * lx + P[2, 1] * ly + P[2, 2] * lz + P[2, 3]
        u = (
            (P[0, 0] * lx + P[0, 1] * ly + P[0, 2] * lz + P[0, 3]) / depth_m
            if depth_m != 0
            else np.nan
        )
        v = (
            (P[1, 0] * lx + P[1, 1] * ly + P[1, 2] * lz + P[1, 3]) / depth_m
            if depth_m != 0
            else np.nan
        )
        left_u, left_v = u - later_px[k, 0], v - later_px[k, 1]
        misfit = np.sqrt(left_u * left_u + left_v * left_v) / deviations_px[k]
        if not np.isfinite(misfit):
            cost += 0.5 * scale * scale
            continue
        known += 1
        inliers += misfit < max_inlier
        square = (misfit / scale) ** 2
        cost += 0.5 * scale * scale * square / (1 + square)
        px = (M[0, 0] * rx + M[0, 1] * ry + M[0, 2] * rz) / along
        py = (M[1, 0] * rx + M[1, 1] * ry + M[1, 2] * rz) / along
        pz = (M[2, 0] * rx + M[2, 1] * ry + M[2, 2] * rz) / along
        cx, cy, cz = ny * z - nz * y, nz * x - nx * z, nx * y - ny * x
        for i in range(3):
            per_shift = px if i == 0 else (py if i == 1 else pz)
            # -per_shift (n x x) . w + M [x] w - [y] w, and per_shift n . t + t - M t
            by_unknown[i, 0] = -per_shift * cx + M[i, 1] * z - M[i, 2] * y
            by_unknown[i, 1] = -per_shift * cy + M[i, 2] * x - M[i, 0] * z
            by_unknown[i, 2] = -per_shift * cz + M[i, 0] * y - M[i, 1] * x
            by_unknown[i, 3] = per_shift * nx - M[i, 0]
            by_unknown[i, 4] = per_shift * ny - M[i, 1]
            by_unknown[i, 5] = per_shift * nz - M[i, 2]
            by_unknown[i, 3 + i] += 1
            by_unknown[i, 6] = per_shift * shifts_m[k]
            for j in range(7, UNKNOWNS):
                by_unknown[i, j] = 1.0 if j == 10 + i else 0.0
        # -[y], of the turn of the calibration and of that of the motion's error.
        for first in (0, 7):
            by_unknown[0, first + 1] += lz
            by_unknown[0, first + 2] -= ly
            by_unknown[1, first + 2] += lx
            by_unknown[1, first] -= lz
            by_unknown[2, first] += ly
            by_unknown[2, first + 1] -= lx
        for j in range(UNKNOWNS):
            row_u[j], row_v[j] = 0.0, 0.0
            for i in range(3):
                row_u[j] += (P[0, i] - u * P[2, i]) / depth_m * by_unknown[i, j]
                row_v[j] += (P[1, i] - v * P[2, i]) / depth_m * by_unknown[i, j]
        weight = 1 / ((1 + square) ** 2 * deviations_px[k] ** 2)
        for i in range(UNKNOWNS):
            slope[i] += weight * (row_u[i] * left_u + row_v[i] * left_v)
            for j in range(UNKNOWNS):
                curvature[i, j] += weight * (row_u[i] * row_u[j] + row_v[i] * row_v[j])
    return cost, inliers / known if known else 0.0
