"""Configuration of the trackers of moving objects: boxes (the default), or points (the thesis' tracker)."""

from dataclasses import dataclass
from typing import Literal

from perception.errors import UsageError


@dataclass(frozen=True)
class BoxTrackerConfig:
    """Tracker of moving objects as boxes, the default: confirmation, reporting and deletion of tracks.

    Attributes:
        min_observed_s: Time over which a well observed track is observed as moving before it is confirmed; at
            least twice, and scans that miss it do not count.
        min_observed_poorly_s: The same of a track of few points.
        min_points_well_observed: Number of points, over all observations, of a well observed track.
        min_travel_m: Minimum distance from the first position before a track is confirmed, beyond the jitter of sides.
        min_speed_m_s: Minimum mean speed since the first observation before a track is confirmed; slower than
            the slowest pedestrian.
        max_unseen_unconfirmed_s: Time without an observation after which a scan that misses an unconfirmed track
            deletes it; at 10 Hz it may miss every second scan.
        max_unseen_s: Time without an observation after which a scan that misses a confirmed track deletes it; a
            car passes in front of a pedestrian within it.
        max_unseen_reported_s: Time without an observation for which a track of many observations is reported.
        max_static_reported_s: Time for which a track that is continued by static clusters is reported.
        max_static_s: Time after which a track that is continued by static clusters is deleted.
    """

    min_observed_s: float = 0.1
    min_observed_poorly_s: float = 0.4
    min_points_well_observed: int = 50
    min_travel_m: float = 0.15
    min_speed_m_s: float = 0.5
    max_unseen_unconfirmed_s: float = 0.15
    max_unseen_s: float = 1.1
    max_unseen_reported_s: float = 0.3
    max_static_reported_s: float = 1.0
    max_static_s: float = 3.0


PointTrackerMethod = Literal["thesis", "author"]


@dataclass(frozen=True)
class PointTrackerConfig:
    """The thesis' tracker of moving objects as points (5.2.2, Tracking Module).

    The thesis gives no noise and no gate; these values are the released program's.

    Attributes:
        process_variance: Factor of the identity matrix Q, added every 0.1 s, in m² and (m/s)².
        measurement_variance_m2: Factor of the identity matrix R.
        initial_variance: Factor of the identity matrix P0, in m² and (m/s)²; the initial speed is 0.
        gate_m: Maximum distance of a detection from its track.
    """

    process_variance: float = 5.0
    measurement_variance_m2: float = 0.5
    initial_variance: float = 5.0
    gate_m: float = 4.0

    def __post_init__(self) -> None:
        """Validate that variances and gate are positive."""
        if min(vars(self).values()) <= 0:
            raise UsageError(
                "point tracker", expected="variances and a gate above 0", found=str(self)
            )
