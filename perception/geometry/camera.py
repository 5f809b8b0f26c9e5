"""The pinhole camera: from the LiDAR's frame to pixels."""

import numpy as np

from perception.types import Bool, Calibration, Float, Float64


def project(image_P_src: Float64, points_src: Float) -> tuple[Float64, Float64]:
    """Project (N, 3+) points with a (3, 4) matrix, in homogeneous coordinates (3.1), (6.1).

    Returns:
        (N, 2) pixels u, v (NaN behind the camera) and (N,) depths in metres.
    """
    points = np.ascontiguousarray(points_src[:, :3].T, np.float64)
    homogeneous = image_P_src[:, :3] @ points + image_P_src[:, 3:]
    depth_m = homogeneous[2].copy()
    in_front = depth_m > 1e-6
    # Stored component by component, the order in which later steps read them.
    with np.errstate(invalid="ignore"):
        pixels = np.divide(homogeneous[:2], np.where(in_front, depth_m, np.nan)).T
    return pixels, depth_m


def is_in_view(
    calibration: Calibration, points_velo: Float, image_size_px: tuple[int, int]
) -> Bool:
    """Tell which (N, 3+) points fall inside a (width, height) image."""
    pixels, _ = project(calibration.image_P_velo, points_velo)
    with np.errstate(invalid="ignore"):
        return np.asarray(((pixels >= 0) & (pixels < np.asarray(image_size_px))).all(axis=1))
