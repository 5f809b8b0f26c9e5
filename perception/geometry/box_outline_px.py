"""2D boxes around projected 3D boxes."""

import numpy as np

from perception.geometry.boxes import edges
from perception.geometry.segments import outlines_px, project_segments
from perception.types import Boxes3D, Float64


def box_outlines_px(
    image_P_velo: Float64, boxes_velo: Boxes3D, size_px: tuple[int, int] | None = None
) -> Float64:
    """Return (M, 4) x1 y1 x2 y2 around the projected boxes; NaN of a box that is not in the image.

    Args:
        image_P_velo: (3, 4) projection to pixels.
        boxes_velo: (M) boxes in the LiDAR frame; parts behind the camera are cut off.
        size_px: (width, height) of the image, to whose borders the rectangles are clipped as labels
            are; None for an image without borders.
    """
    known = np.flatnonzero(np.isfinite(boxes_velo.bottom_m).all(axis=1))
    segments = edges(boxes_velo[known]).reshape(-1, 2, 3)
    seen = project_segments(image_P_velo, segments)
    outlines = np.full((len(boxes_velo), 4), np.nan)
    outlines[known] = outlines_px(seen.ends_px, seen.rows // 12, len(known))
    if size_px is not None:
        outlines = np.clip(outlines, 0, np.tile(np.subtract(size_px, 1), 2))
    is_there = (outlines[:, 2:] > outlines[:, :2]).all(axis=1, keepdims=True)
    return np.where(is_there, outlines, np.nan)
