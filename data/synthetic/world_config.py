"""How a synthetic street and its traffic are drawn."""

from dataclasses import dataclass, field

import numpy as np

from data.synthetic.road import RoadShape
from data.synthetic.town import TownStyle
from perception.errors import UsageError


@dataclass(frozen=True)
class WorldConfig:
    """How a street and its traffic are drawn; the defaults make a lively street for a demonstration.

    Attributes:
        road: curves, slopes and cross-section.
        town: how the street is built up.
        ego_m_s: speed that the ego vehicle wishes for.
        leader_gap_m: from the ego vehicle to the first vehicle before it.
        vehicle_gap_m: mean distance between the vehicles of a lane.
        cyclists: in 100 m of street, both sides together.
        pedestrians: in 100 m of street, both sides together.
        crossing_every_s: between two people who cross before the ego vehicle, 0 for none.
        slowdown_every_s: between two slowdowns of the vehicle before the ego vehicle, 0 for none.
        is_sunny: whether the sun casts shadows.
    """

    road: RoadShape = field(default_factory=RoadShape)
    town: TownStyle = field(default_factory=TownStyle)
    ego_m_s: float = 8.5
    leader_gap_m: float = 15.0
    vehicle_gap_m: float = 30.0
    cyclists: float = 6.0
    pedestrians: float = 14.0
    crossing_every_s: float = 11.0
    slowdown_every_s: float = 9.0
    is_sunny: bool = True

    def __post_init__(self) -> None:
        """Refuse traffic that would not fit on a road."""
        if not (0 < self.ego_m_s <= 20 and self.vehicle_gap_m >= 12 and self.leader_gap_m >= 9):
            raise UsageError(
                "synthetic world",
                expected="ego_m_s up to 20, vehicle_gap_m from 12, leader_gap_m from 9",
                found=f"{self.ego_m_s:g}, {self.vehicle_gap_m:g}, {self.leader_gap_m:g}",
            )


def draw_config(rng: np.random.Generator) -> WorldConfig:
    """Draw another kind of street: narrower, greener, busier, steeper."""
    road = RoadShape(
        curvature_1_m=float(rng.uniform(0, 1 / 110)),
        curve_length_m=float(rng.uniform(150, 260)),
        slope=float(rng.uniform(0, 0.05)),
        bank=float(rng.uniform(0, 0.025)),
        lane_m=float(rng.uniform(3.3, 4.0)),
        parking_m=float(rng.choice([0.0, 2.1, 2.1, 2.3])),
        kerb_m=float(rng.uniform(0.10, 0.15)),
        pavement_m=float(rng.uniform(2.2, 4.0)),
    )
    style = TownStyle(
        houses=float(rng.uniform(0.1, 0.95)),
        greenery=float(rng.uniform(0.15, 0.8)),
        furniture=float(rng.uniform(0.4, 1.0)),
        parking=float(rng.uniform(0.2, 0.9)),
    )
    return WorldConfig(
        road=road,
        town=style,
        ego_m_s=float(rng.uniform(6, 12)),
        leader_gap_m=float(rng.uniform(11, 45)),
        vehicle_gap_m=float(rng.uniform(18, 45)),
        cyclists=float(rng.uniform(1, 8)),
        pedestrians=float(rng.uniform(3, 20)),
        is_sunny=bool(rng.random() < 0.65),
    )
