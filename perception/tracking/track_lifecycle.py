"""When a track is believed, when it is told of, and when it ends."""

from dataclasses import dataclass

import numpy as np

from perception.tracking.track_table import TrackTable
from perception.types import Bool


@dataclass(frozen=True)
class TrackLifecycleConfig:
    """When a track is believed, and when it ends.

    Attributes:
        min_hits: M, how often a plain thing must be seen moving before it is told of.
        min_hits_poorly_observed: the same of a thing of few points.
        min_points_well_observed: in all sights together, from which on a thing is plain.
        max_unseen_unconfirmed_s: how long a track lives unseen before it is confirmed: with a scan every 0.1 s every
            second scan may miss it.
        min_travel_m: how far a thing must have come since it was first seen, beyond the jitter of its sides.
        min_speed_m_s: how fast, all in all: slower than the slowest walkers. What comes to light here
            and there in a hedge gets nowhere.
        max_unseen_s: how long a confirmed track lives unseen; a car in between passes a walker within it.
        max_unseen_reported_s: how long a track that was seen often is told of unseen.
        min_hits_reported_unseen: how often.
        max_static_reported_s: how long a track that lives on standing things is told of.
        max_static_s: how long such a track lives.
        max_stopping_s: how long after its last sight a track may be continued by a standing thing.
        max_stopping_speed_m_s: how slow it must be; what brakes is slower than it was seen to be.
    """

    min_hits: int = 2
    min_hits_poorly_observed: int = 5
    min_points_well_observed: int = 50
    max_unseen_unconfirmed_s: float = 0.25
    min_travel_m: float = 0.15
    min_speed_m_s: float = 0.5
    max_unseen_s: float = 1.2
    max_unseen_reported_s: float = 0.3
    min_hits_reported_unseen: int = 5
    max_static_reported_s: float = 1.0
    max_static_s: float = 3.0
    max_stopping_s: float = 0.35
    max_stopping_speed_m_s: float = 3.0


def is_confirmed(tracks: TrackTable, config: TrackLifecycleConfig) -> Bool:
    """Tell which tracks have been seen often enough; once believed, always believed."""
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


def is_alive(tracks: TrackTable, stamp_s: float, config: TrackLifecycleConfig) -> Bool:
    """Tell which tracks go on: seen lately and, unless they are confirmed, confirmed soon."""
    limit_s = np.where(tracks.is_confirmed, config.max_unseen_s, config.max_unseen_unconfirmed_s)
    is_lost = stamp_s - tracks.last_seen_s > limit_s + _ROUNDING_S
    is_static = stamp_s - tracks.last_moved_s > config.max_static_s + _ROUNDING_S
    return np.asarray(~is_lost & ~is_static)


def may_be_static(tracks: TrackTable, stamp_s: float, config: TrackLifecycleConfig) -> Bool:
    """Tell which confirmed tracks, unseen in this scan, may have come to a stand."""
    is_fresh = stamp_s - tracks.last_seen_s <= config.max_stopping_s + _ROUNDING_S
    is_slow = tracks.speeds_m_s <= config.max_stopping_speed_m_s
    return np.asarray(tracks.is_confirmed & (tracks.last_seen_s < stamp_s) & is_fresh & is_slow)


def is_reported(tracks: TrackTable, stamp_s: float, config: TrackLifecycleConfig) -> Bool:
    """Tell which tracks are worth reporting."""
    limit_s = np.where(
        tracks.hits >= config.min_hits_reported_unseen, config.max_unseen_reported_s, 0.0
    )
    is_observed = stamp_s - tracks.last_seen_s <= limit_s + _ROUNDING_S
    moves = stamp_s - tracks.last_moved_s <= config.max_static_reported_s + _ROUNDING_S
    return np.asarray(tracks.is_confirmed & is_observed & moves)


_ROUNDING_S = 1e-3
