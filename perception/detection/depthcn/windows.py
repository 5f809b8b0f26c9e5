"""Windows of the network's crops around proposals.

The thesis crops the proposal's box and stretches it to the network's input. The default crops a window of
fixed size in metres, so that every car has its true size, with its surroundings:

          7 m
    +-------------+
    |             |     box at the bottom centre of the window, above a margin
    |    +----+   |
    |    | box|   |
    |____+----+___|
"""

from typing import Literal

import numpy as np

from perception.types import Float, Float64

CROP_HEIGHT_PX, CROP_WIDTH_PX = 66, 112  # the network's input (6.1.3)
WindowKind = Literal["box", "metric"]

_WIDTH_M = 7.0  # a car from the side, with a margin
_MARGIN = 0.15  # below the box, share of the window's height


def windows_px(kind: WindowKind, boxes_px: Float64, depths_m: Float, focal_px: float) -> Float64:
    """Return the (M, 4) windows x1 y1 x2 y2, which may extend beyond the image.

    Args:
        kind: Kind of window: `box` is the proposal (thesis), `metric` has a fixed size in metres.
        boxes_px: (M, 4) boxes x1 y1 x2 y2 of the proposals.
        depths_m: (M,) depths of the proposals in metres.
        focal_px: Focal length of the camera in pixels.
    """
    if kind == "box":
        return boxes_px.astype(np.float64)
    width = _WIDTH_M * focal_px / np.maximum(depths_m, 1.0)
    height = width * CROP_HEIGHT_PX / CROP_WIDTH_PX
    center, bottom = (boxes_px[:, 0] + boxes_px[:, 2]) / 2, boxes_px[:, 3] + _MARGIN * height
    return np.stack([center - width / 2, bottom - height, center + width / 2, bottom], axis=1)
