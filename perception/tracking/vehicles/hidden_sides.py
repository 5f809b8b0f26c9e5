"""Left and right sides of boxes in the image that nearer objects hide."""

import numpy as np

from perception.types import Bool, Float64

_MIN_HIDING_HEIGHT = 0.5  # minimum share of the height at which a nearer box hides a side
_MAX_HIDING_GAP = 0.15  # maximum gap between that side and the nearer box, as a share of the width
_MIN_HIDING_DEPTH_M = 1.0  # minimum difference of the depths of their middles


def hidden_sides(boxes_px: Float64, depths_m: Float64) -> Bool:
    """Return (T, 4) which sides x1 y1 x2 y2 are behind a nearer box; upper and lower sides never are.

    Example: the right side of the far box is hidden, the left one is not.

        +----far---+---------+
        |          |  near   |
        +----------+         |
                   +---------+

    Args:
        boxes_px: (T, 4) boxes in one image.
        depths_m: (T,) depths of their objects.
    """
    x1, y1, x2, y2 = boxes_px.T
    shared_px = np.minimum(y2[:, None], y2) - np.maximum(y1[:, None], y1)
    hides = shared_px >= _MIN_HIDING_HEIGHT * (y2 - y1)[:, None]
    hides &= depths_m < depths_m[:, None] - _MIN_HIDING_DEPTH_M
    gaps_px = _MAX_HIDING_GAP * (x2 - x1)[:, None]
    hides_left = hides & (x1 < x1[:, None]) & (x2 > x1[:, None] - gaps_px)
    hides_right = hides & (x2 > x2[:, None]) & (x1 < x2[:, None] + gaps_px)
    is_hidden = np.zeros(boxes_px.shape, bool)
    is_hidden[:, 0], is_hidden[:, 2] = hides_left.any(axis=1), hides_right.any(axis=1)
    return is_hidden
