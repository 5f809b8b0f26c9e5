"""All tracks of a tracker as columns of one table, so that a scan costs a few array operations."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.tracking.columns import GroundPlaneTracks
from perception.types import Bool, Float64, Int


@dataclass(frozen=True)
class TrackTable(GroundPlaneTracks):
    """T tracks of moving objects.

    Attributes:
        ids: (T,) rising.
        yaw_rad: (T,) heading.
        yaw_variance: (T,) of the heading.
        sizes_m: (T, 2) remembered length and width.
        recent_sizes_m: (T, 3, 2) length and width as seen the last three times, the newest first.
        complete_counts: (T, 2) how often length and width were seen from end to end.
        heights_m: (T,) remembered.
        low_world_m: (T,) z of the ground under it.
        first_seen_s: (T,) stamp of the first sight.
        first_seen_world_m: (T, 2) place of the first sight.
        last_seen_s: (T,) stamp of the last sight.
        last_moved_s: (T,) stamp of the last sight as something that moves.
        hits: (T,) how often it was seen moving.
        points: (T,) how many points it has shown in all.
        is_confirmed: (T,)
    """

    ids: Int
    yaw_rad: Float64
    yaw_variance: Float64
    sizes_m: Float64
    recent_sizes_m: Float64
    complete_counts: Int
    heights_m: Float64
    low_world_m: Float64
    first_seen_s: Float64
    first_seen_world_m: Float64
    last_seen_s: Float64
    last_moved_s: Float64
    hits: Int
    points: Int
    is_confirmed: Bool

    @classmethod
    def empty(cls) -> Self:
        """Return no tracks."""
        none, whole = np.zeros(0), np.zeros(0, np.int64)
        return cls(
            ids=whole,
            mean=np.zeros((0, 4)),
            covariance=np.zeros((0, 4, 4)),
            yaw_rad=none,
            yaw_variance=none,
            sizes_m=np.zeros((0, 2)),
            recent_sizes_m=np.zeros((0, 3, 2)),
            complete_counts=np.zeros((0, 2), np.int64),
            heights_m=none,
            low_world_m=none,
            first_seen_s=none,
            first_seen_world_m=np.zeros((0, 2)),
            last_seen_s=none,
            last_moved_s=none,
            hits=whole,
            points=whole,
            is_confirmed=np.zeros(0, bool),
        )
