"""The pinhole camera: from the LiDAR's frame to pixels."""

import numpy as np

from perception.types import Bool, Calibration, Float, Float64


def project(image_P_src: Float64, points_src: Float) -> tuple[Float64, Float64]:
    """Project (N, 3+) points with a (3, 4) matrix, in homogeneous coordinates (3.1), (6.1).

    Returns:
        (N, 2) pixels u, v (NaN behind the camera) and (N,) depths in metres.
    """
    homogeneous = np.asarray(points_src[:, :3], np.float64) @ image_P_src[:, :3].T
    homogeneous += image_P_src[:, 3]
    depth_m = homogeneous[:, 2].copy()
    in_front = depth_m > 1e-6
    pixels = np.full((len(depth_m), 2), np.nan)
    pixels[in_front] = homogeneous[in_front, :2] / depth_m[in_front, None]
    return pixels, depth_m


def is_in_view(
    calibration: Calibration, points_velo: Float, image_size_px: tuple[int, int]
) -> Bool:
    """Tell which (N, 3+) points fall inside a (width, height) image."""
    pixels, _ = project(calibration.image_P_velo, points_velo)
    with np.errstate(invalid="ignore"):
        return np.asarray(((pixels >= 0) & (pixels < np.asarray(image_size_px))).all(axis=1))
