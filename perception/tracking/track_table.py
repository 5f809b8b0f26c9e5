"""Table of the tracks of the box tracker, so that a scan costs a few array operations, and the rules by which tracks live."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from perception.tracking.config import BoxTrackerConfig
from perception.tracking.tracker import GroundPlaneTracks
from perception.types import Bool, Float64, Int

_MIN_HITS_REPORTED_UNSEEN = 5  # number of hits of a track that is reported without an observation
_MAX_STOPPING_S = 0.35  # since the last observation, within which a static cluster may go on
_MAX_STOPPING_SPEED_M_S = 3.0  # maximum speed of such a track
ROUNDING_S = 1e-3  # of stamps


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


def is_confirmed(tracks: TrackTable, config: BoxTrackerConfig) -> Bool:
    """Return whether each track is confirmed: observed often enough and moving; a confirmed track stays so."""
    age_s = tracks.last_seen_s - tracks.first_seen_s
    travelled_m = np.linalg.norm(tracks.mean[:, :2] - tracks.first_seen_world_m, axis=1)
    travels = (
        (travelled_m >= config.min_travel_m)
        & (travelled_m >= config.min_speed_m_s * age_s)
        & (tracks.speeds_m_s >= config.min_speed_m_s)
    )
    is_well_observed = tracks.points >= config.min_points_well_observed
    needed = np.where(is_well_observed, config.min_hits, config.min_hits_poorly_observed)
    return np.asarray(tracks.is_confirmed | ((tracks.hits >= needed) & travels))


def is_alive(tracks: TrackTable, stamp_s: float, config: BoxTrackerConfig) -> Bool:
    """Return whether each track is kept: observed recently, and as a moving object not too long ago."""
    limit_s = np.where(tracks.is_confirmed, config.max_unseen_s, config.max_unseen_unconfirmed_s)
    is_lost = stamp_s - tracks.last_seen_s > limit_s + ROUNDING_S
    is_static = stamp_s - tracks.last_moved_s > config.max_static_s + ROUNDING_S
    return np.asarray(~is_lost & ~is_static)


def may_be_static(tracks: TrackTable, stamp_s: float, config: BoxTrackerConfig) -> Bool:
    """Return whether each confirmed track that is not observed in this scan may have stopped."""
    is_fresh = stamp_s - tracks.last_seen_s <= _MAX_STOPPING_S + ROUNDING_S
    is_slow = tracks.speeds_m_s <= _MAX_STOPPING_SPEED_M_S
    return np.asarray(tracks.is_confirmed & (tracks.last_seen_s < stamp_s) & is_fresh & is_slow)


def is_reported(tracks: TrackTable, stamp_s: float, config: BoxTrackerConfig) -> Bool:
    """Return whether each track is reported."""
    limit_s = np.where(tracks.hits >= _MIN_HITS_REPORTED_UNSEEN, config.max_unseen_reported_s, 0.0)
    is_observed = stamp_s - tracks.last_seen_s <= limit_s + ROUNDING_S
    moves = stamp_s - tracks.last_moved_s <= config.max_static_reported_s + ROUNDING_S
    return np.asarray(tracks.is_confirmed & is_observed & moves)
