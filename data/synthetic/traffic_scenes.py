"""Scripted traffic around the ego vehicle: the three scenes by which the thesis shows its DATMO (Fig. 7.6).

Seen from above, the road running to the right, s ahead and l to the left:

    highway               junction                crossing
    <<< oncoming              |  v  joins          v |  ^ |
    --------------        <<< oncoming            ---+----+---
    ego >>> slower >>>    ego >>>  ^ joins        ego waits
    overtakes >>>>            |                      v  ^
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Literal, get_args

import numpy as np

from data.synthetic import actors as actor_models
from data.synthetic import town, vehicles
from data.synthetic.actors import Actor, Body
from data.synthetic.drive import SyntheticDrive
from data.synthetic.motion import Path
from data.synthetic.road import Road, RoadShape
from data.synthetic.town import Clearing, TownConfig
from data.synthetic.vehicle_designs import BodyStyle, draw_design
from data.synthetic.world import World, assemble
from data.synthetic.world_config import WorldConfig
from perception.sensor import HDL_64E, LidarModel
from perception.types import Float64

TrafficScene = Literal["highway", "junction", "crossing"]
TRAFFIC_SCENES: tuple[TrafficScene, ...] = get_args(TrafficScene)

_STEP_S, _MARGIN_S = 0.05, 2.0
_JUNCTION_M = 24.0  # from the ego vehicle's start to the middle of the side road
_SIDE_ROAD_M = 14.0  # half the length of road without houses at the side road
_TURN_M = 7.0  # radius of a turn into the road

# Positions s and l in metres at some times in seconds.
Waypoints = Callable[[Float64], tuple[Float64, Float64]]


@dataclass(frozen=True)
class _Participant:
    """One vehicle of a scene.

    Attributes:
        style: Body style; None for a cyclist.
        waypoints: Positions over time.
        facing: Direction in which it faces: 1 along the road, -1 against it, 0 along its own path.
    """

    style: BodyStyle | None
    waypoints: Waypoints
    facing: int = 1


class TrafficSceneDrive(SyntheticDrive):
    """A drive through one scene, on a flat, wide road."""

    def __init__(
        self,
        scene: TrafficScene,
        frames: int = 60,
        *,
        seed: int = 0,
        sensor: LidarModel = HDL_64E,
        images: bool = True,
    ) -> None:
        """Draw the road and its traffic.

        Args:
            scene: Scene.
            frames: Number of scans.
            seed: Seed of the street, of appearances and of all noise.
            sensor: LiDAR model.
            images: Whether frames carry images.
        """
        self._scene = scene
        super().__init__(frames, seed=seed, sensor=sensor, images=images)
        self.name, self.root = scene, FilePath(scene)

    def _build_world(self, config: WorldConfig, rng: np.random.Generator) -> World:
        del config
        return _build_world(self._scene, self._frames / self.sensor.rate_hz, rng)


def _build_world(scene: TrafficScene, duration_s: float, rng: np.random.Generator) -> World:
    is_highway = scene == "highway"
    shape = RoadShape(
        curvature_1_m=0.0,
        slope=0.0,
        bank=0.0,
        crown=0.0,
        lane_m=14.0 if is_highway else 8.0,
        parking_m=0.0,
        kerb_m=0.0,
    )
    houses, furniture = (0.0, 0.3) if is_highway else (0.4, 0.6)
    style = TownConfig(houses, greenery=0.4, furniture=furniture, parking=0.0, backdrop=0.0)
    times_s = np.arange(-_MARGIN_S, duration_s + _MARGIN_S, _STEP_S)
    ego_m_s, participants = _SCENES[scene]
    ego = Path(times_s, ego_m_s * times_s, np.full_like(times_s, -2.0))
    stretch = float(ego.s_m.min()) - 60, float(ego.s_m.max()) + 90
    road = Road(shape, start_m=stretch[0] - 100, end_m=stretch[1] + 100)
    clearings = [] if is_highway else [Clearing(_JUNCTION_M, _SIDE_ROAD_M)]

    def is_free(s_m: float, length_m: float, side: int) -> bool:
        del side
        return not any(abs(s_m + length_m / 2 - c.s_m) < c.half_m + length_m / 2 for c in clearings)

    parts = town.lay_out_street(road, stretch, style, clearings, rng, is_free)
    actors = [_actor(number, one, times_s, rng) for number, one in enumerate(participants)]
    return assemble(WorldConfig(road=shape, town=style), road, parts, actors, ego, rng)


def _actor(
    track_id: int, participant: _Participant, times_s: Float64, rng: np.random.Generator
) -> Actor:
    if participant.style is None:
        body = actor_models.draw_cyclists(rng, 1)[0]
    else:
        design = draw_design(participant.style, rng)
        kind = "Van" if participant.style.is_van else "Car"
        body = Body(kind, design.size_m, (vehicles.build(design),))
    path = Path(times_s, *participant.waypoints(times_s), facing=participant.facing or 1)
    appearance = actor_models.draw_appearance(body, rng)
    return Actor(track_id, body, appearance, path, is_steered=participant.facing == 0)


def _along(start_m: float, speed_m_s: float, lane_m: float) -> Waypoints:
    """Keep a lane at a speed, negative of oncoming traffic."""
    return lambda times_s: (start_m + speed_m_s * times_s, np.full_like(times_s, lane_m))


def _across(at_m: float, start_m: float, speed_m_s: float) -> Waypoints:
    """Cross the road at a place, from a distance to its left."""
    return lambda times_s: (np.full_like(times_s, at_m), start_m + speed_m_s * times_s)


def _joining(side: int, arrival_s: float, speed_m_s: float, lane_m: float, along: int) -> Waypoints:
    """Come down the side road and turn into a lane.

    Args:
        side: Side from which it comes: 1 left, -1 right.
        arrival_s: Time at which the turn begins.
        speed_m_s: Speed.
        lane_m: Position of the lane to the left of the centreline.
        along: Direction after the turn: 1 along the road, -1 against it.
    """
    arc_m = _TURN_M * np.pi / 2

    def waypoints(times_s: Float64) -> tuple[Float64, Float64]:
        travelled_m = speed_m_s * (times_s - arrival_s)
        before_m, after_m = np.minimum(travelled_m, 0.0), np.maximum(travelled_m - arc_m, 0.0)
        angle_rad = np.clip(travelled_m, 0.0, arc_m) / _TURN_M
        ahead_m = _TURN_M * (1 - np.cos(angle_rad)) + after_m
        beside_m = _TURN_M * (1 - np.sin(angle_rad)) - before_m
        return _JUNCTION_M + along * ahead_m, lane_m + side * beside_m

    return waypoints


# Speed of the ego vehicle in m/s, and the other vehicles of each scene.
_SCENES: dict[TrafficScene, tuple[float, Sequence[_Participant]]] = {
    "highway": (
        20.0,
        [
            _Participant(BodyStyle.SALOON, _along(22.0, 17.0, -2.0)),
            _Participant(BodyStyle.PANEL_VAN, _along(14.0, 17.5, -6.0)),
            _Participant(BodyStyle.ESTATE, _along(-28.0, 27.0, 2.0)),
            _Participant(BodyStyle.HATCHBACK, _along(90.0, -18.0, 6.5), -1),
            _Participant(BodyStyle.SALOON, _along(170.0, -20.0, 6.5), -1),
        ],
    ),
    "junction": (
        4.0,
        [
            _Participant(BodyStyle.HATCHBACK, _along(34.0, -7.0, 2.0), -1),
            _Participant(BodyStyle.SALOON, _joining(-1, 2.2, 5.5, -2.0, 1), 0),
            _Participant(BodyStyle.SMALL_VAN, _joining(1, 3.4, 5.5, 2.0, -1), 0),
        ],
    ),
    "crossing": (
        0.0,
        [
            _Participant(BodyStyle.ESTATE, _across(14.0, 14.0, -6.0), 0),
            _Participant(BodyStyle.HATCHBACK, _across(18.0, -22.0, 6.5), 0),
            _Participant(BodyStyle.PANEL_VAN, _across(22.0, 24.0, -7.0), 0),
            _Participant(None, _across(8.5, -12.0, 3.5)),
        ],
    ),
}
