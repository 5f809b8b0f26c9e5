"""Left and right sides of boxes in the image that nearer objects hide."""

import numpy as np

from perception.tracking.vehicles.config import VehicleTrackerConfig
from perception.types import Bool, Float64


def hidden_sides(boxes_px: Float64, depths_m: Float64, config: VehicleTrackerConfig) -> Bool:
    """Return (T, 4) which sides x1 y1 x2 y2 are behind a nearer box; upper and lower sides never are.

    Example: the right side of the far box is hidden, the left one is not.

        +----far---+---------+
        |          |  near   |
        +----------+         |
                   +---------+

    Args:
        boxes_px: (T, 4) boxes in one image.
        depths_m: (T,) depths of their objects.
        config: Depth, height and gap at which a box hides another.
    """
    x1, y1, x2, y2 = boxes_px.T
    shared_px = np.minimum(y2[:, None], y2) - np.maximum(y1[:, None], y1)
    hides = shared_px >= config.min_hiding_height * (y2 - y1)[:, None]
    hides &= depths_m < depths_m[:, None] - config.min_hiding_depth_m
    gaps_px = config.max_hiding_gap * (x2 - x1)[:, None]
    hides_left = hides & (x1 < x1[:, None]) & (x2 > x1[:, None] - gaps_px)
    hides_right = hides & (x2 > x2[:, None]) & (x1 < x2[:, None] + gaps_px)
    is_hidden = np.zeros(boxes_px.shape, bool)
    is_hidden[:, 0], is_hidden[:, 2] = hides_left.any(axis=1), hides_right.any(axis=1)
    return is_hidden
