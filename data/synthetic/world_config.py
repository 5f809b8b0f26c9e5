"""Configuration of a synthetic street and its traffic."""

from dataclasses import dataclass, field

from data.synthetic.clutter import ClutterConfig
from data.synthetic.road import RoadShape
from data.synthetic.town import TownConfig
from perception.errors import UsageError


@dataclass(frozen=True)
class WorldConfig:
    """Configuration of a street and its traffic; the defaults make a busy street for a demonstration.

    Attributes:
        road: Curves, slopes and cross-section of the road.
        town: Buildings and vegetation along the street.
        clutter: Other objects along the street.
        ego_m_s: Desired speed of the ego vehicle in m/s.
        leader_gap_m: Distance from the ego vehicle to the first vehicle ahead in metres.
        vehicle_gap_m: Mean distance between the vehicles of a lane in metres.
        ego_lane: Lane of the ego vehicle, 0 beside the centreline.
        is_mixed_fleet: Whether vehicles of all styles drive, and not only the commonest.
        heavy: Share of the vehicles that are trucks or buses.
        vans: Share of the cars and vans that are vans, beside those of the fleet.
        light_trucks: Share of the cars and vans, driving and parked, that are light trucks and pick-ups instead.
        trams: Share of the vehicles that are trams.
        trailers: Share of the cars that tow a small trailer, and of the parking places with one.
        motorcyclists: Share of the vehicles that are motorcycles and scooters.
        cyclists: Number of cyclists per 100 m of street, both sides together.
        cycle_paths: Share of the cyclists who ride on the pavement instead of the lane.
        pedestrians: Number of pedestrians per 100 m of street, both sides together; a group counts once.
        groups: Share of the pedestrians who walk or stand in groups of two to five.
        is_mixed_crowd: Whether children and people of all builds walk and stand, with and without bags.
        waiting: Number of groups of one to seven people per 100 m of street who stand on the pavements.
        sheltered: Share of these groups that stand under the roof of a bus stop, and are twice as large.
        at_vehicles: Share of the parked vehicles with someone beside them.
        footpath_m: Distance in metres from the pavements to a footpath that half of the pedestrians
            and cyclists take, 0 for none.
        crossing_every_s: Seconds between two pedestrians who cross in front of the ego vehicle, 0 for none.
        slowdown_every_s: Seconds between two slowdowns of the vehicle ahead, 0 for none.
        stop_every_s: Mean number of seconds between two stops of a vehicle in any lane, 0 for none.
        is_sunny: Whether the sun casts shadows.
        is_night: Whether lamps of vehicles and a faint sky are all the light there is.
        absorption: Share of the shots on black vehicles and clothes that the LiDAR loses at any range.
        tunnel_m: Entrance and exit of a tunnel in metres along the road, 0 and 0 for none.
    """

    road: RoadShape = field(default_factory=RoadShape)
    town: TownConfig = field(default_factory=TownConfig)
    clutter: ClutterConfig = field(default_factory=ClutterConfig)
    ego_m_s: float = 8.5
    leader_gap_m: float = 15.0
    vehicle_gap_m: float = 30.0
    ego_lane: int = 0
    is_mixed_fleet: bool = False
    heavy: float = 0.0
    vans: float = 0.0
    light_trucks: float = 0.0
    trams: float = 0.0
    trailers: float = 0.0
    motorcyclists: float = 0.0
    cyclists: float = 6.0
    cycle_paths: float = 0.0
    pedestrians: float = 14.0
    groups: float = 0.0
    is_mixed_crowd: bool = False
    waiting: float = 0.0
    sheltered: float = 0.0
    at_vehicles: float = 0.0
    footpath_m: float = 0.0
    crossing_every_s: float = 11.0
    slowdown_every_s: float = 9.0
    stop_every_s: float = 0.0
    is_sunny: bool = True
    is_night: bool = False
    absorption: float = 0.0
    tunnel_m: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        """Validate speeds, gaps and the lane of the ego vehicle."""
        if not (0 < self.ego_m_s <= 20 and self.vehicle_gap_m >= 12 and self.leader_gap_m >= 9):
            raise UsageError(
                "synthetic world",
                expected="ego_m_s above 0 up to 20, vehicle_gap_m from 12, leader_gap_m from 9",
                found=f"{self.ego_m_s:g}, {self.vehicle_gap_m:g}, {self.leader_gap_m:g}",
            )
        if not 0 <= self.ego_lane < self.road.lanes:
            raise UsageError(
                "synthetic world",
                expected=f"an ego_lane below the {self.road.lanes} lanes of its road",
                found=str(self.ego_lane),
            )
