"""Back-projection of a pixel to a position in space, by the LiDAR points around it (5.3.4)."""

import numpy as np

from perception.geometry.camera import project
from perception.types import Float, Float64


def back_project(center_px: Float64, points_velo: Float, image_P_velo: Float64) -> Float64 | None:
    """Return (3,) the position in the LiDAR frame of a pixel.

    It is the bilinear mean of the nearest point in each of the four quadrants around the pixel: of the upper
    two and of the lower two at the pixel's column, then of both at its row. With fewer quadrants, their points
    have equal weights.

    Args:
        center_px: (2,) column and row.
        points_velo: (N, 3+) points of the object and near it.
        image_P_velo: (3, 4) projection from the LiDAR frame to pixels.

    Returns:
        None where no point is in front of the camera.
    """
    pixels, _ = project(image_P_velo, points_velo)
    in_front = np.isfinite(pixels).all(axis=1)
    away_px = pixels[in_front] - center_px
    corners = [_nearest_of(quadrant, away_px) for quadrant in _quadrants(away_px)]
    found = [corner for corner in corners if corner is not None]
    if not found:
        return None
    weights = _bilinear(away_px[found]) if len(found) == 4 else np.full(len(found), 1 / len(found))
    return np.asarray(weights @ points_velo[in_front][found, :3].astype(np.float64))


def _quadrants(away_px: Float64) -> list[np.ndarray]:
    """Return the points to the upper left, upper right, lower left and lower right; axes belong to both sides."""
    right, down = away_px.T
    return [
        np.flatnonzero((side * right >= 0) & (level * down >= 0))
        for level in (-1, 1)
        for side in (-1, 1)
    ]


def _nearest_of(rows: np.ndarray, away_px: Float64) -> int | None:
    if len(rows) == 0:
        return None
    return int(rows[np.argmin((away_px[rows] ** 2).sum(axis=1))])


def _bilinear(corners_px: Float64) -> Float64:
    """Return (4,) weights for which the mean of the corners is 0: upper left, upper right, lower two."""
    (upper, upper_row), (lower, lower_row) = _at_column(corners_px[:2]), _at_column(corners_px[2:])
    height = lower_row - upper_row
    share = -upper_row / height if height > 0 else 0.5
    return np.concatenate([upper * (1 - share), lower * share])


def _at_column(pair_px: Float64) -> tuple[Float64, float]:
    """Return (2,) weights of a left and a right point where the line between them has column 0; and its row."""
    (left, _), (right, _) = pair_px
    share = -left / (right - left) if right > left else 0.5
    weights = np.array([1 - share, share])
    return weights, float(weights @ pair_px[:, 1])
