"""Configuration of the trackers of moving objects: boxes (the default), or points (the thesis' tracker)."""

from dataclasses import dataclass
from typing import Literal

from perception.errors import UsageError
from perception.geometry.grids import MOVING_OBJECT_AREA, LocalArea


@dataclass(frozen=True)
class BoxTrackerConfig:
    """Tracker of moving objects as boxes, the default: confirmation, reporting and deletion of tracks.

    Attributes:
        min_hits: Number of moving observations before a well observed track is confirmed (M).
        min_hits_poorly_observed: Number of moving observations before a track of few points is confirmed.
        min_points_well_observed: Number of points, over all observations, of a well observed track.
        min_travel_m: Minimum distance from the first position before a track is confirmed, beyond the jitter of sides.
        min_speed_m_s: Minimum mean speed since the first observation before a track is confirmed; slower than
            the slowest pedestrian.
        max_unseen_unconfirmed_s: Time without an observation after which an unconfirmed track is deleted; at 10 Hz
            it may miss every second scan.
        max_unseen_s: Time without an observation after which a confirmed track is deleted; a car passes in front
            of a pedestrian within it.
        max_unseen_reported_s: Time without an observation for which a track of many hits is reported.
        max_static_reported_s: Time for which a track that is continued by static clusters is reported.
        max_static_s: Time after which a track that is continued by static clusters is deleted.
    """

    min_hits: int = 2
    min_hits_poorly_observed: int = 5
    min_points_well_observed: int = 50
    min_travel_m: float = 0.15
    min_speed_m_s: float = 0.5
    max_unseen_unconfirmed_s: float = 0.25
    max_unseen_s: float = 1.2
    max_unseen_reported_s: float = 0.3
    max_static_reported_s: float = 1.0
    max_static_s: float = 3.0


@dataclass(frozen=True)
class PointTrackerConfig:
    """The thesis' tracker of moving objects as points (5.2.2, Tracking Module).

    The thesis gives no noise and no gate; those values are the released program's.

    Attributes:
        step_s: Time step of the filters; None takes it from the stamps. The released program assumes 0.1 s.
        process_variance: Factor of the identity matrix Q, added every 0.1 s, in m² and (m/s)².
        measurement_variance_m2: Factor of the identity matrix R.
        initial_variance: Factor of the identity matrix P0, in m² and (m/s)²; the initial speed is 0.
        gate_m: Maximum distance of a detection from its track.
        gate_around: Centre of the gate: the predicted position, as the thesis implies, or the last estimate
            (released program).
        on_miss: Estimate of a track without a detection: its prediction (thesis), or a correction by the last
            position, which brakes the track to a halt (released program).
        confirms: Whether a new track is deleted where the next frame does not detect it (thesis).
        area: Local grid in the LiDAR frame, outside of which no track is reported (5.2.2: 10 m behind, 30 m
            ahead, 10 m to each side).
        kept_beyond_area_m: Distance outside the local grid at which a track is deleted.
    """

    step_s: float | None = None
    process_variance: float = 5.0
    measurement_variance_m2: float = 0.5
    initial_variance: float = 5.0
    gate_m: float = 4.0
    gate_around: Literal["prediction", "last estimate"] = "prediction"
    on_miss: Literal["predict", "hold"] = "predict"
    confirms: bool = True
    area: LocalArea = MOVING_OBJECT_AREA
    kept_beyond_area_m: float = 0.0

    def __post_init__(self) -> None:
        """Validate that time step, variances and gate are positive."""
        positive = (self.process_variance, self.measurement_variance_m2, self.initial_variance)
        if min(*positive, self.gate_m, 1.0 if self.step_s is None else self.step_s) <= 0:
            raise UsageError(
                "point tracker", expected="a step, variances and a gate above 0", found=str(self)
            )


THESIS_POINT_TRACKER = PointTrackerConfig()
# The released program deletes no track, so that its cost grows with the drive. A detection lies in the
# local grid, and nothing beyond the gate around it can matter unless the vehicle comes back; 40 m, the
# length of the grid, lets it turn round and still find its tracks.
AUTHOR_POINT_TRACKER = PointTrackerConfig(
    step_s=0.1,
    gate_around="last estimate",
    on_miss="hold",
    confirms=False,
    kept_beyond_area_m=40.0,
)
