"""Ranking of proposals, where only some can be verified."""

from typing import Literal

import numpy as np

from perception.detection.depthcn.proposals import Proposals
from perception.types import Float64

ProposalOrder = Literal["size", "points"]

# Visible size of a car: its height, and the width from the end of a small one to the side of a large one.
_CAR_HEIGHT_M = 1.5
_CAR_WIDTHS_M = (1.5, 4.5)
_MIN_SIZE_M = 1e-3  # of a box without extent


def order_scores(order: ProposalOrder, proposals: Proposals, focal_px: float) -> Float64:
    """Return the (M,) ranking scores, the highest to be verified first.

    Args:
        order: Criterion: `size` prefers height and width of a car in metres, `points` the number of returns, which
            prefers near proposals.
        proposals: Proposals of one scan.
        focal_px: Focal length of the camera in pixels.
    """
    if order == "points":
        belongs = proposals.clusters >= 0
        counts = np.bincount(proposals.clusters[belongs], minlength=len(proposals))
        return counts.astype(np.float64)
    width, height = np.log(np.maximum(proposals.sizes_m(focal_px), _MIN_SIZE_M)).T
    narrowest, widest = np.log(_CAR_WIDTHS_M)
    width_error = np.abs(width - np.clip(width, narrowest, widest))
    return np.asarray(-np.abs(height - np.log(_CAR_HEIGHT_M)) - width_error)
