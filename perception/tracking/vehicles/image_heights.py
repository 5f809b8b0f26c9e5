"""Heights of objects by the upper sides of their boxes in the image."""

import numpy as np

from perception.geometry.boxes import corners
from perception.types import Boxes3D, Float64


def image_heights_m(boxes: Boxes3D, boxes_px: Float64, image_P_velo: Float64) -> Float64:
    """Return (F,) the heights at which none of the upper corners is projected above the upper side of a 2D box.

    Args:
        boxes: (F) boxes of any height in the LiDAR frame.
        boxes_px: (F, 4) boxes in the image.
        image_P_velo: (3, 4) projection from the LiDAR frame to pixels.
    """
    corners_m = corners(boxes)[:, :4]
    # The height above each corner of the bottom at which it is projected to the upper side of the 2D box.
    planes = image_P_velo[1] - boxes_px[:, 1, None, None] * image_P_velo[2]
    beside = (planes[..., :2] * corners_m[..., :2]).sum(axis=2) + planes[..., 3]
    tops_m = -beside / planes[..., 2]
    return np.asarray((tops_m - corners_m[..., 2]).min(axis=1))
