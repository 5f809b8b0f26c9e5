"""Generate the traffic: actors and their paths, without collisions."""

import numpy as np

from data.synthetic import actors as actor_models
from data.synthetic import furniture, meshes, street, traffic
from data.synthetic.actors import Actor, Body
from data.synthetic.fleet import Fleet
from data.synthetic.motion import Path
from data.synthetic.road import Road
from data.synthetic.street import Part
from data.synthetic.town import Clearing
from data.synthetic.traffic import Block, Lane, Slowdown
from data.synthetic.world_config import WorldConfig
from perception.types import Float64

_EGO_LENGTH_M = 4.6
_LONG_M = 6.5
_MIN_GAP_M = 3.0  # between bumpers at the start


class TrafficGenerator:
    """Generates actors and their paths, without collisions."""

    def __init__(
        self, config: WorldConfig, road: Road, duration_s: float, rng: np.random.Generator
    ) -> None:
        self.config, self.road, self.rng = config, road, rng
        self.duration_s = duration_s
        self.times_s = traffic.simulation_times(duration_s)
        self.actors: list[Actor] = []
        self.clearings: list[Clearing] = []
        self.fleet = Fleet(config, rng)
        self._crossers: list[Path] = []
        self._tracks: list[tuple[Float64, float]] = []
        self.ego = self._drive()

    def _drive(self) -> Path:
        """Simulate both lanes; return the ego vehicle's path."""
        lane, bodies, ego_row = self._own_lane()
        slowdowns = self._slowdowns(ego_row) + self._stops(len(bodies))
        free = traffic.simulate_lane(lane, self.times_s, [], slowdowns)[:, ego_row]
        own_blocks, oncoming_blocks = self._crossings(free)
        places = traffic.simulate_lane(lane, self.times_s, own_blocks, slowdowns)
        centre = 0.1 - (self.config.ego_lane + 0.5) * self.road.shape.lane_m
        for row, body in enumerate(bodies):
            if row != ego_row:
                self._add(body, Path(self.times_s, places[:, row], self._wander(centre)), 1.1)
        for number in range(self.road.shape.lanes):
            self._oncoming(oncoming_blocks, (number + 0.5) * self.road.shape.lane_m)
            if number != self.config.ego_lane:
                self._alongside(-(number + 0.5) * self.road.shape.lane_m)
        ego = Path(self.times_s, places[:, ego_row], self._wander(centre))
        self._tracks.append((self._sampled(ego), 1.3))
        return ego

    def _own_lane(self) -> tuple[Lane, list[Body], int]:
        """Draw the vehicles before, at and behind the ego vehicle."""
        config, rng = self.config, self.rng
        gaps = config.vehicle_gap_m * rng.uniform(0.7, 1.4, 6)
        gaps[0] = config.leader_gap_m * rng.uniform(0.9, 1.1)
        ahead = np.cumsum(gaps)[::-1]
        behind = -np.cumsum(config.vehicle_gap_m * rng.uniform(0.5, 1.2, 3))
        bodies = [self.fleet.driving() for _ in range(len(ahead) + 1 + len(behind))]
        place = np.concatenate([ahead, [0.0], behind]) - 0.95 * traffic.WARM_UP_S * config.ego_m_s
        desired = config.ego_m_s * rng.uniform(0.9, 1.08, len(place))
        length = np.array([body.lane_m for body in bodies])
        length[len(ahead)] = _EGO_LENGTH_M
        place = _apart(place, length, len(ahead))
        desired[len(ahead)] = config.ego_m_s * 1.1
        return Lane(place, length, desired), bodies, len(ahead)

    def _slowdowns(self, ego_row: int) -> list[Slowdown]:
        every = self.config.slowdown_every_s
        starts = np.arange(6.0, self.duration_s, every) if every > 0 else np.zeros(0)
        return [
            Slowdown(ego_row - 1 - n % 2, float(t), float(t + 1.6), (0.5, 0.25, 0.0)[n % 3])
            for n, t in enumerate(starts)
        ]

    def _stops(self, vehicles: int) -> list[Slowdown]:
        """Draw stops in a lane: one of its vehicles stands for some seconds, and all behind it."""
        every = self.config.stop_every_s
        count = round(vehicles * self.duration_s / every) if every else 0
        rows = self.rng.integers(vehicles, size=count)
        starts_s = self.rng.uniform(-traffic.WARM_UP_S, self.duration_s, count)
        stops_s = starts_s + self.rng.uniform(1.0, 4.0, count)
        return [
            Slowdown(int(row), float(start), float(stop), 0.0)
            for row, start, stop in zip(rows, starts_s, stops_s, strict=True)
        ]

    def _alongside(self, l_m: float) -> None:
        """Draw the vehicles of another lane of the same direction."""
        config, rng = self.config, self.rng
        gaps = config.vehicle_gap_m * rng.uniform(0.5, 2.0, int(260 / config.vehicle_gap_m) + 2)
        place = 130.0 - np.cumsum(gaps) - 0.95 * traffic.WARM_UP_S * config.ego_m_s
        bodies = [self.fleet.driving() for _ in place]
        length = np.array([body.lane_m for body in bodies])
        desired = config.ego_m_s * rng.uniform(0.85, 1.15, len(place))
        lane = Lane(_apart(place, length, 0), length, desired)
        places = traffic.simulate_lane(lane, self.times_s, [], self._stops(len(bodies)))
        for row, body in enumerate(bodies):
            self._add_inside(body, Path(self.times_s, places[:, row], self._wander(l_m)))

    def _oncoming(self, blocks: list[Block], l_m: float) -> None:
        """Draw the vehicles of a lane of the other direction; their places run against the road."""
        config, rng = self.config, self.rng
        speed = config.ego_m_s * 1.0
        farthest = 2.05 * (self.duration_s + traffic.WARM_UP_S) * speed + 150.0
        gaps = config.vehicle_gap_m * rng.uniform(
            0.6, 1.7, int(farthest / config.vehicle_gap_m) + 5
        )
        place = 60.0 - np.cumsum(gaps)
        bodies = [self.fleet.driving() for _ in place]
        desired = speed * rng.uniform(0.92, 1.08, len(place))
        length = np.array([body.lane_m for body in bodies])
        lane = Lane(_apart(place, length, 0), length, desired)
        stops = [Slowdown(int(row), 1.0, 4.0, 0.0) for row in range(2, len(place), 9)]
        stops += self._stops(len(bodies))
        places = traffic.simulate_lane(lane, self.times_s, blocks, stops)
        for row, body in enumerate(bodies):
            path = Path(self.times_s, -places[:, row], self._wander(l_m), facing=-1)
            self._add_inside(body, path)

    def _add_inside(self, body: Body, path: Path) -> None:
        """Add a vehicle unless it would leave the road."""
        if path.s_m.min() > self.road.start_m + 5 and path.s_m.max() < self.road.end_m - 5:
            self._add(body, path, 1.1)

    def _crossings(self, ego_place_m: Float64) -> tuple[list[Block], list[Block]]:
        """Let people cross before the ego vehicle; return when which lane is closed."""
        every, rng, shape = self.config.crossing_every_s, self.rng, self.road.shape
        starts = np.arange(1.0, self.duration_s, every) if every > 0 else np.zeros(0)
        own: list[Block] = []
        oncoming: list[Block] = []
        for start in starts:
            from_side, pace = float(rng.choice([-1, 1])), float(rng.uniform(1.8, 2.4))
            edge = from_side * (shape.half_width_m + 1.2)
            # The ego vehicle would get there as its lane is left: it has to slow down, not to wait.
            lane_left_s = start + (abs(edge) + max(0.0, from_side) * shape.lane_m) / pace
            place = float(np.interp(lane_left_s + 1.6, self.times_s, ego_place_m))
            l_m = edge - from_side * np.clip((self.times_s - start) * pace, 0, 2 * abs(edge))
            s_m = np.full_like(l_m, place)
            self._crossers.append(Path(self.times_s, s_m, l_m))
            self.clearings.append(Clearing(place, 4.0))
            for blocks, low, direction in ((own, -shape.lane_m - 0.3, 1), (oncoming, -0.3, -1)):
                on_lane = self.times_s[(l_m > low) & (l_m < low + shape.lane_m + 0.6)]
                stop = direction * place - 2.2
                if len(on_lane):
                    blocks.append(Block(stop, float(on_lane[0]) - 3.0, float(on_lane[-1])))
        return own, oncoming

    def add_pedestrians_and_cyclists(self, stretch_m: tuple[float, float]) -> None:
        """Add crossing pedestrians, cyclists at the lanes' edges and pedestrians on the pavements."""
        for path in self._crossers:
            self._try_add(self.fleet.walker(), path, 0.35)
        length = stretch_m[1] - stretch_m[0]
        for _ in range(int(self.config.cyclists * length / 100)):
            self._add_cyclist(stretch_m)
        for _ in range(int(self.config.pedestrians * length / 100)):
            self._add_pedestrians(stretch_m)

    def _add_cyclist(self, stretch_m: tuple[float, float]) -> None:
        """Add a cyclist at the lanes' edge, on the pavement or on a footpath."""
        side, shape = int(self.rng.choice([-1, 1])), self.road.shape
        row_m = shape.lanes_m - 0.35
        if self._draws(self.config.cycle_paths):
            row_m = shape.half_width_m + min(1.3, 0.6 * shape.pavement_m)
        row_m = self._off_road(row_m)
        body, pace = self.fleet.rider(), self.rng.uniform(3.6, 5.5)
        self._try_add(body, self._ride(stretch_m, side * row_m, -side, pace), 0.8)

    def _add_pedestrians(self, stretch_m: tuple[float, float]) -> None:
        """Add one pedestrian or a group, on a pavement or a footpath."""
        shape = self.road.shape
        side, direction = self.rng.choice([-1, 1]), int(self.rng.choice([-1, 1]))
        row_m = shape.half_width_m + self.rng.uniform(1.1, max(1.1, shape.pavement_m - 0.4))
        row_m = self._off_road(row_m)
        stands = bool(self.rng.random() < 0.15)
        body, pace = self._pedestrian(stands), 0.0 if stands else self.rng.uniform(1.0, 1.7)
        companions = int(self.rng.integers(1, 5)) if self._draws(self.config.groups) else 0
        # The first of a group keeps away from others, not from his own company.
        radius_m = 0.25 if companions else 0.4
        path = self._ride(stretch_m, side * row_m, direction, pace)
        if self._try_add(body, path, radius_m):
            for number in range(companions):
                along_m, across_m = self.rng.uniform(-0.15, 0.15, 2).tolist()
                s_m = path.s_m + along_m + 0.7 * (number // 2)
                l_m = path.l_m + across_m + 0.65 * (number % 2 + 1)
                beside = Path(self.times_s, s_m, l_m, direction)
                self._try_add(self._pedestrian(stands), beside, radius_m)

    def add_bystanders(self, stretch_m: tuple[float, float]) -> list[Part]:
        """Add groups who wait on the pavements, and people beside parked vehicles and between them.

        Return the roofs over some of these groups.
        """
        roofs = []
        rng, shape, length_m = self.rng, self.road.shape, stretch_m[1] - stretch_m[0]
        parked = [actor for actor in self.actors if actor.path is None]
        for _ in range(int(self.config.waiting * length_m / 100)):
            s_m, side = float(rng.uniform(*stretch_m)), float(rng.choice([-1, 1]))
            l_m = shape.half_width_m + float(rng.uniform(0.4, max(0.5, shape.pavement_m - 0.4)))
            middle_m = self.road.place(np.array(s_m), np.array(side * l_m))
            count, spread_m = int(rng.integers(1, 8)), np.array([0.9, 0.7])
            if self._draws(self.config.sheltered):
                count, spread_m = 2 * count, 2 * spread_m
                roofs.append(self._roof(s_m, side * l_m))
            for _ in range(count):
                self._add_standing(middle_m[:2] + rng.normal(0, spread_m), parked)
        for actor in parked:
            if self._draws(self.config.at_vehicles):
                half_m = np.array(actor.body.size_m[:2]) / 2
                beside_m = rng.choice([-1, 1]) * (half_m[1] + rng.uniform(0.3, 0.8))
                along_m = rng.uniform(-half_m[0] - 0.5, half_m[0] + 0.5)
                pose = actor.world_SE3_parked
                self._add_standing((pose @ [along_m, beside_m, 0, 1])[:2], parked)
        return roofs

    def _roof(self, s_m: float, l_m: float) -> Part:
        """Build a roof over a place of a pavement."""
        size_m = self.rng.uniform((3.0, 1.6), (10.0, 4.0)).tolist()
        pose = street.upright_pose(self.road, s_m, l_m, 0.0 if l_m > 0 else np.pi)
        mesh = meshes.moved(furniture.canopy(self.rng, *size_m), pose)
        return Part(mesh, furniture.panel_palette(self.rng))

    def _add_standing(self, place_m: Float64, parked: list[Actor]) -> None:
        """Let someone stand at a place of the world, facing anywhere, unless it is taken."""
        s_m, l_m = (float(one[0]) for one in self.road.locate(place_m[None]))
        for actor in parked:
            offset_m = place_m - actor.world_SE3_parked[:2, 3]
            local_m = np.abs(offset_m @ actor.world_SE3_parked[:2, :2])
            if (local_m < np.array(actor.body.size_m[:2]) / 2 + 0.25).all():
                return
        body, steady = self.fleet.waiting(), np.ones_like(self.times_s)
        if self._try_add(body, Path(self.times_s, s_m * steady, l_m * steady), 0.25):
            moving = self.actors.pop()
            pose = street.upright_pose(self.road, s_m, l_m, float(self.rng.uniform(0, 2 * np.pi)))
            self.actors.append(Actor(moving.track_id, body, moving.appearance, None, pose))

    def _pedestrian(self, stands: bool) -> Body:
        return self.fleet.waiting() if stands else self.fleet.walker()

    def _draws(self, share: float) -> bool:
        """Draw whether one of many has a property; no number is drawn for a share of 0."""
        return share > 0 and bool(self.rng.random() < share)

    def _off_road(self, row_m: float) -> float:
        """Draw whether a row beside the lanes is left for the footpath."""
        if self.config.footpath_m == 0 or self.rng.random() < 0.5:
            return row_m
        return self.road.shape.outer_m + self.config.footpath_m + float(self.rng.uniform(-1, 1))

    def _ride(
        self, stretch_m: tuple[float, float], l_m: float, direction: int, pace: float
    ) -> Path:
        """Draw a path along the street at a steady pace."""
        middle = self.rng.uniform(stretch_m[0] + 15, stretch_m[1] - 15)
        breath = 1 + 0.12 * np.sin(self.times_s * 0.7 + self.rng.uniform(0, 6))
        travelled_m = np.cumsum(pace * breath) * traffic.STEP_S
        s_m = middle + direction * (travelled_m - travelled_m[len(travelled_m) // 2])
        s_m = np.clip(s_m, self.road.start_m + 10, self.road.end_m - 10)
        return Path(self.times_s, s_m, np.full_like(s_m, l_m), direction)

    def _wander(self, l_m: float) -> Float64:
        """Return the lateral position of a driver within the lane."""
        phases = self.rng.uniform(0, 2 * np.pi, 2)
        drift = np.sin(0.5 * self.times_s + phases[0]) + 0.5 * np.sin(
            0.9 * self.times_s + phases[1]
        )
        return np.asarray(l_m + 0.07 * drift)

    def _sampled(self, path: Path) -> Float64:
        """Return (K, 2) places four times a second."""
        times = np.arange(self.times_s[0], self.times_s[-1], 0.25)
        return np.asarray(self.road.place(*path.at(times))[:, :2])

    def _add(self, body: Body, path: Path, radius_m: float) -> None:
        self._tracks.append((self._sampled(path), radius_m))
        if body.size_m[0] > _LONG_M:
            end_m = body.size_m[0] / 2 - radius_m
            for shift_m in np.linspace(-end_m, end_m, 2 * int(np.ceil(end_m / 3))):
                part = Path(path.times_s, path.s_m + shift_m, path.l_m)
                self._tracks.append((self._sampled(part), radius_m))
        appearance = actor_models.draw_appearance(body, self.rng)
        self.actors.append(Actor(len(self.actors), body, appearance, path))
        if body.trailer is not None:
            behind_m = path.s_m - path.facing * body.towed_m
            self._add(body.trailer, Path(path.times_s, behind_m, path.l_m, path.facing), radius_m)

    def _try_add(self, body: Body, path: Path, radius_m: float) -> bool:
        """Add an actor unless it would collide with another; return whether it was added."""
        places = self._sampled(path)
        for other, reach in self._tracks:
            if (np.linalg.norm(other - places, axis=1) < radius_m + reach).any():
                return False
        self._add(body, path, radius_m)
        return True


def _apart(place_m: Float64, length_m: Float64, fixed: int) -> Float64:
    """Move the vehicles of a lane apart where they would touch, but for one that stays."""
    min_gaps_m = (length_m[:-1] + length_m[1:]) / 2 + _MIN_GAP_M
    if (-np.diff(place_m) >= min_gaps_m).all():
        return place_m
    behind = np.concatenate([[0.0], np.cumsum(np.maximum(-np.diff(place_m), min_gaps_m))])
    return np.asarray(place_m[fixed] + behind[fixed] - behind)
