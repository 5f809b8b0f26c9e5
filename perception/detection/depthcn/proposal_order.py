"""Which proposals to look at first, where not all can be."""

from typing import Literal

import numpy as np

from perception.detection.depthcn.proposals import Proposals
from perception.types import Float64

ProposalOrder = Literal["size", "points"]

# What a camera sees of a car: its height, and from the end of a small one to the side of a large one.
_CAR_HEIGHT_M = 1.5
_CAR_WIDTHS_M = (1.5, 4.5)
_MIN_M = 1e-3  # of a box without extent


def order_scores(order: ProposalOrder, proposals: Proposals, focal_px: float) -> Float64:
    """Return (M,) scores, the highest to be looked at first.

    Args:
        order: `size` by how near height and width in metres come to a car's, `points` by how many returns
            there are, which puts what is near first.
        proposals: of one scan.
        focal_px: of the camera.
    """
    if order == "points":
        belongs = proposals.clusters >= 0
        counts = np.bincount(proposals.clusters[belongs], minlength=len(proposals))
        return counts.astype(np.float64)
    sizes_px = proposals.boxes_px[:, 2:] - proposals.boxes_px[:, :2]
    sizes_m = sizes_px * (proposals.depths_m / focal_px)[:, None]
    width, height = np.log(np.maximum(sizes_m, _MIN_M)).T
    narrowest, widest = np.log(_CAR_WIDTHS_M)
    too_wide_or_narrow = np.abs(width - np.clip(width, narrowest, widest))
    return np.asarray(-np.abs(height - np.log(_CAR_HEIGHT_M)) - too_wide_or_narrow)
