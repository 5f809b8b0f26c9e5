"""Normal equations of the calibration by corners: where they should be in a later image, and how that changes."""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled, written
from perception.types import Float64

_ROWS, _LINE = array_of(np.float64, 2), array_of(np.float64)
UNKNOWNS = 13  # turn and shift of the calibration, sweep, turn and shift of the error of the motion
SHARED = 7  # of these by all frames; each has a motion of its own


@compiled((_ROWS, _ROWS))
def _product(first: Float64, second: Float64) -> Float64:
    """Return the product of two (4, 4) transforms."""
    product = np.zeros((4, 4))
    for i in range(4):
        for j in range(4):
            for k in range(4):
                product[i, j] += first[i, k] * second[k, j]
    return product


@compiled((_ROWS, _ROWS))
def _in_camera(later_SE3_velo: Float64, cam_SE3_velo: Float64) -> Float64:
    """Return a (4, 4) motion of the LiDAR as one of the camera."""
    T, velo_SE3_cam = cam_SE3_velo, np.zeros((4, 4))
    for i in range(3):
        for j in range(3):
            velo_SE3_cam[i, j] = T[j, i]
            velo_SE3_cam[i, 3] -= T[j, i] * T[j, 3]
    velo_SE3_cam[3, 3] = 1
    return _product(_product(cam_SE3_velo, later_SE3_velo), velo_SE3_cam)


@compiled(
    (
        _ROWS, _ROWS, _ROWS, _LINE, _LINE, _ROWS, _ROWS, _ROWS, _ROWS, _LINE, NUMBER, NUMBER, NUMBER,
        WHOLE, written(np.float64, 2), written(np.float64),
    )
)  # fmt: skip
def add_corner_sums(
    planes_velo: Float64,
    rays: Float64,
    later_px: Float64,
    deviations_px: Float64,
    shifts_m: Float64,
    cam_SE3_velo: Float64,
    later_SE3_velo: Float64,
    error_SE3_cam: Float64,
    image_P_cam: Float64,
    center_m: Float64,
    sweep: float,
    scale: float,
    max_inlier: float,
    own: int,
    curvature: Float64,
    slope: Float64,
) -> float:
    """Add the corners of one frame to normal equations of several; return their robust cost.

    With the ray r through a corner, its plane n . x = d and the motion M, all in the camera's frame, it comes to be at
    y = M x with x on the ray and on the plane. A change of the calibration by a turn w and a shift t moves x by
    r (n . t - w . (n x x)) / (n . r), and M by the same change before and after it. Where many corners are elsewhere, those
    that seem to be right tell less: the sums count as the square of the share that is where it should be.

    Args:
        planes_velo: (K, 4) planes in the LiDAR's frame; a corner whose plane is NaN costs as one that is elsewhere.
        rays: (K, 3) rays through the corners, in the camera's frame.
        later_px: (K, 2) where the later image shows them.
        deviations_px: (K,) standard deviations of these.
        shifts_m: (K,) how far planes move along their normals if the LiDAR turns counter-clockwise.
        cam_SE3_velo: (4, 4) calibration.
        later_SE3_velo: (4, 4) motion of the LiDAR.
        error_SE3_cam: (4, 4) its error, in the camera's frame.
        image_P_cam: (3, 4) projection to pixels.
        center_m: (3,) centre of the camera, where the rays begin.
        sweep: Share of the sweep.
        scale: Deviations from which on a corner counts little (Geman-McClure).
        max_inlier: Deviations up to which a corner is where it should be.
        own: First row of the motion's error in the equations.
        curvature: (D, D) that is added to: the calibration, the sweep, then the error of each frame's motion.
        slope: (D,) that is added to.
    """
    T, P = cam_SE3_velo, image_P_cam
    M = _product(error_SE3_cam, _in_camera(later_SE3_velo, cam_SE3_velo))
    cost, known, inliers = 0.0, 0, 0
    row = np.empty(UNKNOWNS)
    sums, slopes = np.zeros((UNKNOWNS, UNKNOWNS)), np.zeros(UNKNOWNS)  # sums above the diagonal
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
        per_depth = 1 / depth_m if depth_m != 0 else np.nan
        u = (P[0, 0] * lx + P[0, 1] * ly + P[0, 2] * lz + P[0, 3]) * per_depth
        v = (P[1, 0] * lx + P[1, 1] * ly + P[1, 2] * lz + P[1, 3]) * per_depth
        left_u, left_v = u - later_px[k, 0], v - later_px[k, 1]
        misfit = np.sqrt(left_u * left_u + left_v * left_v) / deviations_px[k]
        if not np.isfinite(misfit):
            cost += 0.5 * scale * scale
            continue
        known += 1
        inliers += misfit < max_inlier
        square = (misfit / scale) ** 2
        cost += 0.5 * scale * scale * square / (1 + square)
        weight = 1 / ((1 + square) ** 2 * deviations_px[k] ** 2)
        cx, cy, cz = ny * z - nz * y, nz * x - nx * z, nx * y - ny * x
        for axis in range(2):
            pixel, left = (u, left_u) if axis == 0 else (v, left_v)
            # Slopes of the pixel along the later point, then along the earlier one, and with the plane's distance.
            dx = (P[axis, 0] - pixel * P[2, 0]) * per_depth
            dy = (P[axis, 1] - pixel * P[2, 1]) * per_depth
            dz = (P[axis, 2] - pixel * P[2, 2]) * per_depth
            ex = M[0, 0] * dx + M[1, 0] * dy + M[2, 0] * dz
            ey = M[0, 1] * dx + M[1, 1] * dy + M[2, 1] * dz
            ez = M[0, 2] * dx + M[1, 2] * dy + M[2, 2] * dz
            per_shift = (ex * rx + ey * ry + ez * rz) / along
            # The turn of the motion's error, and its shift.
            row[7], row[8], row[9] = ly * dz - lz * dy, lz * dx - lx * dz, lx * dy - ly * dx
            row[10], row[11], row[12] = dx, dy, dz
            row[6] = per_shift * shifts_m[k]
            row[3] = per_shift * nx + dx - ex
            row[4] = per_shift * ny + dy - ey
            row[5] = per_shift * nz + dz - ez
            row[0] = row[7] - per_shift * cx + ey * z - ez * y
            row[1] = row[8] - per_shift * cy + ez * x - ex * z
            row[2] = row[9] - per_shift * cz + ex * y - ey * x
            for i in range(UNKNOWNS):
                weighted = weight * row[i]
                slopes[i] += weighted * left
                for j in range(i, UNKNOWNS):
                    sums[i, j] += weighted * row[j]
    share = inliers / known if known else 0.0
    for i in range(UNKNOWNS):
        into = i if i < SHARED else own + i - SHARED
        slope[into] += share * share * slopes[i]
        for j in range(UNKNOWNS):
            across = j if j < SHARED else own + j - SHARED
            curvature[into, across] += share * share * sums[min(i, j), max(i, j)]
    return cost
