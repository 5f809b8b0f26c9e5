"""Which part of the picture the network sees of a candidate, and how large it sees it.

The thesis cuts out the proposal's box and stretches it to the network's input. The default cuts out a
piece of fixed size in metres, so that every car is seen at its true size with what is around it:

          7 m
    +-------------+
    |             |     the box at the window's bottom centre, a margin below it
    |    +----+   |
    |    | box|   |
    |____+----+___|
"""

from typing import Literal

import numpy as np

from perception.types import Float, Float64

CROP_HEIGHT_PX, CROP_WIDTH_PX = 66, 112  # the network's input (6.1.3)
WindowKind = Literal["box", "metric"]

_WIDTH_M = 7.0  # a car seen from the side, and one that shows only an end
_MARGIN = 0.15  # of the height, below the box


def windows_px(kind: WindowKind, boxes_px: Float64, depths_m: Float, focal_px: float) -> Float64:
    """Return (M, 4) windows x1 y1 x2 y2; they may reach beyond the image.

    Args:
        kind: `box` the proposal itself (thesis), `metric` of fixed size in metres.
        boxes_px: (M, 4) of the proposals.
        depths_m: (M,) how far each lies.
        focal_px: of the camera.
    """
    if kind == "box":
        return boxes_px.astype(np.float64)
    width = _WIDTH_M * focal_px / np.maximum(depths_m, 1.0)
    height = width * CROP_HEIGHT_PX / CROP_WIDTH_PX
    center, bottom = (boxes_px[:, 0] + boxes_px[:, 2]) / 2, boxes_px[:, 3] + _MARGIN * height
    return np.stack([center - width / 2, bottom - height, center + width / 2, bottom], axis=1)
