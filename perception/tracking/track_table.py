"""Table of the tracks of the box tracker, so that a scan costs a few array operations."""

from dataclasses import dataclass
from typing import Annotated

from perception.tracking.tracker import GroundPlaneTracks
from perception.types import Bool, Float64, Int


@dataclass(frozen=True)
class TrackTable(GroundPlaneTracks):
    """T tracks of moving objects.

    Attributes:
        ids: (T,) ids, rising.
        yaw_variance: (T,) variance of the heading, in rad².
        sizes_m: (T, 2) estimated length and width.
        recent_sizes_m: (T, 3, 2) length and width of the last three observations, the newest first.
        complete_counts: (T, 2) number of observations of the whole length and width.
        heights_m: (T,) estimated height.
        first_seen_s: (T,) time of the first observation.
        first_seen_world_m: (T, 2) position of the first observation.
        last_seen_s: (T,) time of the last observation.
        last_moved_s: (T,) time of the last observation as a moving object.
        hits: (T,) number of observations as a moving object.
        points: (T,) number of points of all observations.
        is_confirmed: (T,) whether the track is confirmed.
    """

    ids: Int
    yaw_variance: Float64
    sizes_m: Annotated[Float64, 2]
    recent_sizes_m: Annotated[Float64, 3, 2]
    complete_counts: Annotated[Int, 2]
    heights_m: Float64
    first_seen_s: Float64
    first_seen_world_m: Annotated[Float64, 2]
    last_seen_s: Float64
    last_moved_s: Float64
    hits: Int
    points: Int
    is_confirmed: Bool
