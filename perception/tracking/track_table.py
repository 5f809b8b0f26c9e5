"""All tracks of a tracker as columns of one table, so that a scan costs a few array operations."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.tracking.columns import OnGround
from perception.types import Bool, Float64, Int


@dataclass(frozen=True)
class TrackTable(OnGround):
    """T tracks of moving objects.

    Attributes:
        ids: (T,) rising.
        yaw_rad: (T,) heading.
        yaw_variance: (T,) of the heading.
        sizes_m: (T, 2) remembered length and width.
        recent_sizes_m: (T, 3, 2) length and width as seen the last three times, the newest first.
        complete_seen: (T, 2) how often length and width were seen from end to end.
        heights_m: (T,) remembered.
        low_world_m: (T,) z of the ground under it.
        begun_s: (T,) stamp of the first sight.
        begun_world_m: (T, 2) place of the first sight.
        seen_s: (T,) stamp of the last sight.
        moved_s: (T,) stamp of the last sight as something that moves.
        sights: (T,) how often it was seen moving.
        points: (T,) how many points it has shown in all.
        is_confirmed: (T,)
    """

    ids: Int
    yaw_rad: Float64
    yaw_variance: Float64
    sizes_m: Float64
    recent_sizes_m: Float64
    complete_seen: Int
    heights_m: Float64
    low_world_m: Float64
    begun_s: Float64
    begun_world_m: Float64
    seen_s: Float64
    moved_s: Float64
    sights: Int
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
            complete_seen=np.zeros((0, 2), np.int64),
            heights_m=none,
            low_world_m=none,
            begun_s=none,
            begun_world_m=np.zeros((0, 2)),
            seen_s=none,
            moved_s=none,
            sights=whole,
            points=whole,
            is_confirmed=np.zeros(0, bool),
        )
