"""Table of the tracks of detected vehicles."""

from dataclasses import dataclass, replace
from typing import Annotated, Self

import numpy as np

from perception.tracking.tracker import GroundPlaneTracks
from perception.tracking.vehicles.evidence import probability
from perception.tracking.vehicles.motion_modes import MotionModes
from perception.types import Bool, Float64, Int

_MIN_HIDING_HEIGHT = 0.5  # minimum share of the height at which a nearer box hides a side
_MAX_HIDING_GAP = 0.15  # maximum gap between that side and the nearer box, as a share of the width
_MIN_HIDING_DEPTH_M = 1.0  # minimum difference of the depths of their middles


def hidden_sides(boxes_px: Float64, depths_m: Float64, cameras: Int | None = None) -> Bool:
    """Return (T, 4) which sides x1 y1 x2 y2 are behind a nearer box; upper and lower sides never are.

    Example: the right side of the far box is hidden, the left one is not.

        +----far---+---------+
        |          |  near   |
        +----------+         |
                   +---------+

    Args:
        boxes_px: (T, 4) boxes in images.
        depths_m: (T,) depths of their objects.
        cameras: (T,) numbers of the cameras of the images; None where it is one.
    """
    x1, y1, x2, y2 = boxes_px.T
    shared_px = np.minimum(y2[:, None], y2) - np.maximum(y1[:, None], y1)
    hides = shared_px >= _MIN_HIDING_HEIGHT * (y2 - y1)[:, None]
    hides &= depths_m < depths_m[:, None] - _MIN_HIDING_DEPTH_M
    if cameras is not None:
        hides &= cameras == cameras[:, None]
    gaps_px = _MAX_HIDING_GAP * (x2 - x1)[:, None]
    hides_left = hides & (x1 < x1[:, None]) & (x2 > x1[:, None] - gaps_px)
    hides_right = hides & (x2 > x2[:, None]) & (x1 < x2[:, None] + gaps_px)
    is_hidden = np.zeros(boxes_px.shape, bool)
    is_hidden[:, 0], is_hidden[:, 2] = hides_left.any(axis=1), hides_right.any(axis=1)
    return is_hidden


@dataclass(frozen=True)
class VehicleTable(GroundPlaneTracks):
    """T tracked vehicles.

    Attributes:
        modes: (T) both motions, of which the state is the mean.
        ids: (T,) ids; -1 of unconfirmed tracks.
        class_evidence: (T, C) logarithms of the likelihoods of each class.
        scores: (T,) score of the last detection.
        evidence: (T,) log-odds that the track is an object.
        detections: (T,) number of detections.
        last_seen_s: (T,) time of the last detection.
        boxes_px: (T, 4) box in the image at the last detection.
        cameras: (T,) number of the camera of that image.
        anchors_px: (T, 3) column, row and depth in metres of the middle of the 3D box at the last detection.
        is_located: (T,) whether it was ever located by its returns; otherwise its position is assumed from its
            height in the image, and heading and size are void.
        last_located_s: (T,) time of the last detection that was located.
        travelled: (T,) distance ahead while it surely moved, in quarters of its length, which are log-odds of its front.
        riding_votes: (T,) detections at which it was surely faster than a walker, less those at which it was slower.
        axis: (T, 2) sum of the observed headings, as cosine and sine of twice the angle.
        front_odds: (T,) log-odds of its front by its shape and the traffic.
        sizes_m: (T, 3) mean length, width and height.
        size_weights: (T, 3) weights of the observations of the mean.
    """

    modes: MotionModes
    ids: Int
    class_evidence: Annotated[Float64, ...]
    scores: Float64
    evidence: Float64
    detections: Int
    last_seen_s: Float64
    boxes_px: Annotated[Float64, 4]
    cameras: Int
    anchors_px: Annotated[Float64, 3]
    is_located: Bool
    last_located_s: Float64
    travelled: Float64
    riding_votes: Int
    axis: Annotated[Float64, 2]
    front_odds: Float64
    sizes_m: Annotated[Float64, 3]
    size_weights: Annotated[Float64, 3]

    def moved(self, modes: MotionModes) -> Self:
        """Return the tracks with other motions."""
        merged = modes.merged
        return replace(self, modes=modes, mean=merged.mean, covariance=merged.covariance)

    @property
    def reversal(self) -> Float64:
        """(T,) probability that the front is the rear."""
        return probability(-np.maximum(self.front_odds + self.travelled, 0.0))

    @property
    def middles_world(self) -> Float64:
        """(T, 3) middles of the 3D boxes in the world."""
        return np.column_stack([self.mean[:, :2], self.low_world_m + self.sizes_m[:, 2] / 2])

    @property
    def speed_deviations_m_s(self) -> Float64:
        """(T,) larger standard deviation of the velocity along x or y."""
        variances = np.diagonal(self.covariance, axis1=1, axis2=2)[:, 2:]
        return np.asarray(np.sqrt(variances.max(axis=1, initial=0.0)))
