"""The pinhole camera: projection of points, of line segments, and of the outlines of boxes.

Segments are clipped in homogeneous coordinates, before the division by depth, where a line that passes behind the
camera is still straight.
"""

from dataclasses import dataclass

import numpy as np

from perception.geometry.boxes import CORNERS, EDGES
from perception.kernels.box_outlines import box_outlines
from perception.types import Bool, Boxes3D, Calibration, Float, Float64, Int


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


NEAREST_M = 0.3


@dataclass(frozen=True)
class ProjectedSegments:
    """The K of S segments that are partly in view.

    Attributes:
        rows: (K,) indices of the segments, rising.
        ends_px: (K, 2, 2) columns and rows of both ends of that part, in the segment's direction.
    """

    rows: Int
    ends_px: Float64

    def __len__(self) -> int:
        """Return K."""
        return len(self.rows)


def project_segments(
    image_P_src: Float64,
    segments_m: Float64,
    size_px: tuple[int, int] | None = None,
    *,
    margin_px: float = 0.0,
) -> ProjectedSegments:
    """Project (S, 2, 3) segments and clip them to the field of view.

    Args:
        image_P_src: (3, 4) projection to pixels.
        segments_m: (S, 2, 3) both ends of each segment in the source frame.
        size_px: (width, height) of the image, or None for one that has no borders.
        margin_px: Distance in pixels beyond the borders at which lines end.
    """
    ends = segments_m @ image_P_src[:, :3].T + image_P_src[:, 3]
    # Signed distances of both ends from the planes around the view (Cyrus and Beck): inside is positive.
    planes = _view_planes(size_px, margin_px)
    start, stop = np.moveaxis(ends @ planes.T, 1, 0)
    start[:, 0] -= NEAREST_M
    stop[:, 0] -= NEAREST_M
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = start / (start - stop)
    enters = np.where((start < 0) & (stop >= 0), crossing, 0.0).max(axis=1)
    leaves = np.where((stop < 0) & (start >= 0), crossing, 1.0).min(axis=1)
    is_observed = ~((start < 0) & (stop < 0)).any(axis=1) & (enters <= leaves)
    shares = np.column_stack([enters, leaves])[is_observed, :, None]
    cut = ends[is_observed, :1] * (1 - shares) + ends[is_observed, 1:] * shares
    return ProjectedSegments(np.flatnonzero(is_observed), cut[..., :2] / cut[..., 2:])


def outlines_px(ends_px: Float64, owners: Int, count: int) -> Float64:
    """Return (count, 4) x1 y1 x2 y2 around the (K, 2, 2) segments of each owner; x1 > x2 where it has none."""
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    np.minimum.at(low, owners, ends_px.min(axis=1))
    np.maximum.at(high, owners, ends_px.max(axis=1))
    return np.hstack([low, high])


def _view_planes(size_px: tuple[int, int] | None, margin_px: float) -> Float64:
    """Return the planes around the view, a row each over (u w, v w, w), the near one first."""
    planes = [(0.0, 0.0, 1.0)]
    if size_px is not None:
        right, bottom = (length - 1 + margin_px for length in size_px)
        planes += [(1, 0, margin_px), (0, 1, margin_px), (-1, 0, right), (0, -1, bottom)]
    return np.array(planes)


def box_outlines_px(
    image_P_velo: Float64, boxes_velo: Boxes3D, size_px: tuple[int, int] | Int | None = None
) -> Float64:
    """Return (M, 4) x1 y1 x2 y2 around the projected boxes; NaN of a box that is not in the image.

    Args:
        image_P_velo: (3, 4) projection to pixels, or (M, 3, 4) one for each box.
        boxes_velo: (M) boxes in the LiDAR frame; parts behind the camera are cut off.
        size_px: (width, height) of the image, or (M, 2), to whose borders the rectangles are clipped as labels
            are; None for an image without borders.
    """
    boxes = np.column_stack([boxes_velo.bottom_m, boxes_velo.size_m, boxes_velo.yaw_rad])
    limits_px = np.array([[-np.inf, -np.inf, np.inf, np.inf]])
    if size_px is not None:
        highest_px = np.atleast_2d(np.subtract(size_px, 1.0))
        limits_px = np.hstack([np.zeros_like(highest_px), highest_px])
    projections = np.ascontiguousarray(image_P_velo.reshape(-1, 3, 4), np.float64)
    return box_outlines(boxes, projections, limits_px, CORNERS, EDGES, NEAREST_M)
