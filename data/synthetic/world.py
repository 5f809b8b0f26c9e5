"""A street with its traffic, drawn from a seed: the exact truth of a synthetic drive."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from data.synthetic import clutter, meshes, town
from data.synthetic.actors import Actor
from data.synthetic.motion import Path, vehicle_poses
from data.synthetic.parking import Parking
from data.synthetic.raycasting import MovingObject, RaycastingScene
from data.synthetic.road import Road
from data.synthetic.roadside import draw_plots, land_outside
from data.synthetic.street import Part, StaticBox
from data.synthetic.structures import Tunnel
from data.synthetic.traffic_generator import TrafficGenerator
from data.synthetic.world_config import WorldConfig
from perception.types import Float64

_PARKING_LOT_M, _BAY_M = (12.0, 34.0), (2.5, 9.0)  # limits of lengths along the road
_BEHIND_M, _AHEAD_M = 100.0, 135.0  # how far the street is built around the ego vehicle's way


# Moments that are remembered: scan, image and labels of a frame ask for the same one, two frames at a time.
_REMEMBERED_MOMENTS = 4


@dataclass(frozen=True)
class Moment:
    """Where the vehicle and the actors are at one time.

    Attributes:
        ego_s_m: Position of the ego vehicle along the road in metres.
        ego_xy_m: (2,) its place in the world.
        states: States of the actors that were asked for, by track id.
        along_m: Their positions along the road in metres, by track id.
    """

    ego_s_m: float
    ego_xy_m: Float64
    states: dict[int, MovingObject] = field(default_factory=dict)
    along_m: dict[int, float] = field(default_factory=dict)


@dataclass(frozen=True)
class World:
    """A street with its traffic.

    Attributes:
        config: World configuration.
        road: Ground as a formula.
        scene: Scene for ray casting.
        actors: All actors but the ego vehicle, by track id.
        ego: Path of the ego vehicle.
        sway_rad: (3, 2) phases of the ego body's sway in roll, pitch and heave.
        sun: (3,) unit vector towards the sun.
        shapes: Indices of each actor's shapes in the scene, by track id.
        object_rows: Row of each actor in the scene's tables, by track id.
        sensor_unit: Serial number of the LiDAR, whose lasers differ from those of others.
        static_boxes: Boxes of static objects of classes that KITTI does not have.
    """

    config: WorldConfig
    road: Road
    scene: RaycastingScene
    actors: Sequence[Actor]
    ego: Path
    sway_rad: Float64
    sun: Float64
    shapes: Sequence[tuple[int, ...]]
    object_rows: Sequence[int]
    sensor_unit: int = 0
    static_boxes: Sequence[StaticBox] = ()
    _moments: dict[float, Moment] = field(default_factory=dict, repr=False, compare=False)

    @property
    def tunnel(self) -> Tunnel | None:
        """The tunnel of the road, None without one."""
        return tunnel_of(self.config, self.road)

    def world_SE3_body(self, times_s: Float64) -> Float64:
        """Return (K, 4, 4) poses of the ego body over the road: sway, and pitch under braking."""
        poses = vehicle_poses(self.road, self.ego, times_s)
        ahead, behind = self.ego.at(times_s + 0.2)[0], self.ego.at(times_s - 0.2)[0]
        acceleration = (ahead - 2 * self.ego.at(times_s)[0] + behind) / 0.04
        speed = (ahead - behind) / 0.4
        share = np.clip(speed / 8.0, 0, 1.5)
        beats_hz = np.array([[0.9, 1.7], [1.1, 2.1], [1.2, 2.3]])
        beat = 2 * np.pi * beats_hz * np.asarray(times_s)[:, None, None] + self.sway_rad
        sway = np.sin(beat).sum(axis=2) * share[:, None] * (0.0018, 0.0015, 0.006)
        pitch = sway[:, 1] - 0.004 * acceleration
        small = np.zeros((len(poses), 4, 4))
        small[:] = np.eye(4)
        small[:, 0, 2], small[:, 2, 0] = pitch, -pitch
        small[:, 1, 2], small[:, 2, 1] = -sway[:, 0], sway[:, 0]
        small[:, 2, 3] = sway[:, 2]
        # First order rotations of milliradians; made square again by the polar factor.
        left, _, right = np.linalg.svd(small[:, :3, :3])
        small[:, :3, :3] = left @ right
        return np.asarray(poses @ small)

    def moving_at(self, time_s: float, within_m: float) -> tuple[list[Actor], list[MovingObject]]:
        """Return the actors with a way of their own around the ego vehicle, and their states."""
        near = [
            actor
            for actor in self.actors
            if actor.path is not None and self.is_near(actor, time_s, within_m)
        ]
        return near, [self.state(actor, time_s) for actor in near]

    def is_near(self, actor: Actor, time_s: float, within_m: float) -> bool:
        """Return whether an actor is within a distance of the ego vehicle, measured along the road."""
        if actor.path is None:
            return self.is_place_near(actor.world_SE3_parked, time_s, within_m)
        moment = self._moment(time_s)
        if actor.track_id not in moment.along_m:
            moment.along_m[actor.track_id] = float(actor.path.at(time_s)[0])
        return abs(moment.along_m[actor.track_id] - moment.ego_s_m) < within_m

    def is_place_near(self, world_SE3_object: Float64, time_s: float, within_m: float) -> bool:
        """Return whether a place is within a distance of the ego vehicle."""
        offset = world_SE3_object[:2, 3] - self._moment(time_s).ego_xy_m
        return bool(offset @ offset < within_m**2)

    def _moment(self, time_s: float) -> Moment:
        """Return what is remembered of a time."""
        moment = self._moments.get(time_s)
        if moment is None:
            s_m, l_m = self.ego.at(time_s)
            moment = Moment(float(s_m), self.road.place(s_m, l_m)[:2])
            for oldest in list(self._moments)[: 1 - _REMEMBERED_MOMENTS]:
                self._moments.pop(oldest, None)
            self._moments[time_s] = moment
        return moment

    def footprints(
        self, moving: Sequence[MovingObject], centre_m: Float64, within_m: float
    ) -> list[tuple[Float64, float, float]]:
        """Return pose, length and width of the vehicles around a place."""
        by_object = {state.object_row: state.world_SE3_object for state in moving}
        found = []
        for actor, object_row in zip(self.actors, self.object_rows, strict=True):
            pose = actor.world_SE3_parked if actor.path is None else by_object.get(object_row)
            if pose is None or actor.body.is_person:
                continue
            if np.linalg.norm(pose[:3, 3] - centre_m) < within_m:
                found.append((pose, *actor.body.size_m[:2]))
        return found

    def state(self, actor: Actor, time_s: float) -> MovingObject:
        """Return where an actor is, and which shape it has there."""
        states = self._moment(time_s).states
        if actor.track_id not in states:
            shape = self.shapes[actor.track_id][actor.phase(time_s)]
            pose, velocity = actor.pose(self.road, time_s), actor.velocity_m_s(self.road, time_s)
            object_row = self.object_rows[actor.track_id]
            states[actor.track_id] = MovingObject(shape, object_row, pose, velocity)
        return states[actor.track_id]


def tunnel_of(config: WorldConfig, road: Road) -> Tunnel | None:
    """Return the tunnel of a road, None without one."""
    return Tunnel(road, *config.tunnel_m) if any(config.tunnel_m) else None


def build_world(config: WorldConfig, duration_s: float, rng: np.random.Generator) -> World:
    """Draw a street and its traffic for a drive of some duration."""
    reach = config.ego_m_s * 1.1 * (duration_s + 8) + 60
    road = Road(
        config.road,
        rng.uniform(0, 2 * np.pi, 3),
        start_m=-(_BEHIND_M + 120),
        end_m=2 * reach + _AHEAD_M + 120,
    )
    plan = TrafficGenerator(config, road, duration_s, rng)
    stretch = (plan.ego.s_m.min() - _BEHIND_M, plan.ego.s_m.max() + _AHEAD_M)
    own = rng.spawn(1)[0]
    parking_lots = draw_plots(stretch, config.clutter.parking_lots, _PARKING_LOT_M, own)
    bays = [
        bay
        for bay in draw_plots(stretch, config.clutter.bays, _BAY_M, own)
        if all(abs(bay.middle_m - c.s_m) > c.half_m + bay.length_m / 2 for c in plan.clearings)
    ]

    is_free = land_outside(parking_lots)
    parts = town.lay_out_street(road, stretch, config.town, plan.clearings, rng, is_free)
    parts += clutter.place_clutter(road, stretch, config.clutter, plan.clearings, own, is_free)
    parts += clutter.place_bays(road, bays, own)
    if tunnel := tunnel_of(config, road):
        parts += tunnel.parts()
    plan.add_pedestrians_and_cyclists(stretch)
    parking = Parking(road, plan.fleet, config.town.parking, plan.actors, rng)
    parking.along_road(stretch, plan.clearings, config.town.parking_rad, land_outside(bays))
    parking.off_road(parking_lots)
    parts += plan.add_bystanders(stretch)
    return assemble(config, road, parts, plan.actors, plan.ego, rng)


def assemble(
    config: WorldConfig,
    road: Road,
    parts: Sequence[Part],
    actors: Sequence[Actor],
    ego: Path,
    rng: np.random.Generator,
) -> World:
    """Build the scene of static parts, parked vehicles and the shapes of moving actors."""
    scene = RaycastingScene([*parts, *(_parked(actor) for actor in actors if actor.path is None)])
    shapes_of: dict[int, tuple[int, ...]] = {}
    for actor in actors:
        if id(actor.body) not in shapes_of:
            added = tuple(scene.add_shape(mesh) for mesh in actor.body.poses)
            shapes_of[id(actor.body)] = added
    object_rows = [
        scene.add_object(actor.appearance, actor.body.semantic, actor.track_id + 1)
        for actor in actors
    ]
    scene.finish()
    azimuth, elevation = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(18, 60))
    level = np.cos(elevation)
    return World(
        config,
        road,
        scene,
        actors,
        ego,
        sway_rad=rng.uniform(0, 2 * np.pi, (3, 2)),
        sun=np.array([np.cos(azimuth) * level, np.sin(azimuth) * level, np.sin(elevation)]),
        shapes=[shapes_of[id(actor.body)] for actor in actors],
        object_rows=object_rows,
        sensor_unit=int(rng.integers(1000)),
        static_boxes=[part.box for part in parts if part.box is not None],
    )


def _parked(actor: Actor) -> Part:
    """Return a parked vehicle as a static part."""
    mesh = meshes.moved(actor.body.poses[0], actor.world_SE3_parked)
    return Part(mesh, actor.appearance, actor.body.semantic, actor.track_id + 1)
