"""Heights of objects by the upper sides of their boxes in the image."""

import numpy as np

from perception.geometry.boxes import corners
from perception.types import Boxes3D, Float64

_TOP_DEVIATION_PX = 1.0  # of the upper side of a 2D box
_TOP_DEVIATION_SHARE = 0.05  # increase of it with the height of the box


def top_deviations(boxes_px: Float64) -> Float64:
    """Return (F,) standard deviations of the upper sides of (F, 4) boxes in the image, in their heights."""
    heights_px = np.maximum(boxes_px[:, 3] - boxes_px[:, 1], 1.0)
    return np.asarray(_TOP_DEVIATION_PX / heights_px + _TOP_DEVIATION_SHARE)


def image_heights_m(boxes: Boxes3D, boxes_px: Float64, image_P_velo: Float64) -> Float64:
    """Return (F,) the heights at which none of the upper corners is projected above the upper side of a 2D box.

    Args:
        boxes: (F) boxes of any height in the LiDAR frame.
        boxes_px: (F, 4) boxes in the image.
        image_P_velo: (3, 4) projection from the LiDAR frame to pixels, or (F, 3, 4).
    """
    corners_m = corners(boxes)[:, :4]
    # The height above each corner of the bottom at which it is projected to the upper side of the 2D box.
    rows = image_P_velo[..., None, :]
    planes = rows[..., 1, :, :] - boxes_px[:, 1, None, None] * rows[..., 2, :, :]
    beside = (planes[..., :2] * corners_m[..., :2]).sum(axis=2) + planes[..., 3]
    tops_m = -beside / planes[..., 2]
    return np.asarray((tops_m - corners_m[..., 2]).min(axis=1))
