"""Table of the tracks of the box tracker, so that a scan costs a few array operations, and the rules by which tracks live."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from perception.tracking.config import BoxTrackerConfig
from perception.tracking.tracker import GroundPlaneTracks
from perception.types import Bool, Float64, Int

# Time over which a track is observed before it is reported without an observation.
_MIN_OBSERVED_UNSEEN_S = 0.4
_MAX_STOPPING_S = 0.25  # unseen by the last scan, within which a static cluster may go on
MAX_PAUSE_S = 2.0  # between two scans, over which objects are found again
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
        observed_s: (T,) time from scan to scan at whose end it was observed as a moving object.
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
    observed_s: Float64
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
    needed_s = np.where(is_well_observed, config.min_observed_s, config.min_observed_poorly_s)
    is_lasting = (tracks.hits > 1) & (tracks.observed_s >= needed_s - ROUNDING_S)
    return np.asarray(tracks.is_confirmed | (is_lasting & travels))


def is_alive(tracks: TrackTable, stamp_s: float, config: BoxTrackerConfig) -> Bool:
    """Return whether a scan keeps each track: observed recently, and as a moving object not too long ago."""
    limit_s = np.where(tracks.is_confirmed, config.max_unseen_s, config.max_unseen_unconfirmed_s)
    is_lost = stamp_s - tracks.last_seen_s > limit_s + ROUNDING_S
    is_static = stamp_s - tracks.last_moved_s > config.max_static_s + ROUNDING_S
    return np.asarray(~is_lost & ~is_static)


def may_be_static(tracks: TrackTable, stamp_s: float, before_s: float) -> Bool:
    """Return whether each confirmed track that is not observed in this scan may have stopped.

    Args:
        tracks: T tracks.
        stamp_s: Time of this scan.
        before_s: Time of the scan before.
    """
    is_fresh = before_s - tracks.last_seen_s <= _MAX_STOPPING_S + ROUNDING_S
    is_slow = tracks.speeds_m_s <= _MAX_STOPPING_SPEED_M_S
    return np.asarray(tracks.is_confirmed & (tracks.last_seen_s < stamp_s) & is_fresh & is_slow)


def is_reported(tracks: TrackTable, stamp_s: float, config: BoxTrackerConfig) -> Bool:
    """Return whether each track is reported."""
    is_known = tracks.observed_s >= _MIN_OBSERVED_UNSEEN_S - ROUNDING_S
    limit_s = np.where(is_known, config.max_unseen_reported_s, 0.0)
    is_observed = stamp_s - tracks.last_seen_s <= limit_s + ROUNDING_S
    moves = stamp_s - tracks.last_moved_s <= config.max_static_reported_s + ROUNDING_S
    return np.asarray(tracks.is_confirmed & is_observed & moves)
