"""A spinning LiDAR in a world: rays fired while the vehicle moves, then compensated as KITTI's are.

The head turns counter-clockwise seen from above, from straight behind at the start of a turn over
straight ahead, at the frame's time, to straight behind again. Points are given in the LiDAR's frame at
the frame's time, the vehicle's own motion taken out; what moves by itself stays smeared, as in reality.
"""

from dataclasses import dataclass, replace

import numpy as np

from data.synthetic.actors import MOVING_M_S
from data.synthetic.echoes import EchoModel, Shots
from data.synthetic.materials import column
from data.synthetic.raycasting import Hits, MovingObject, Rays, near_any
from data.synthetic.textures import marking_reflectance
from data.synthetic.world import World
from perception.errors import UsageError
from perception.geometry import se3
from perception.geometry.grids import EgoVehicle
from perception.sensor import LidarModel
from perception.types import Bool, Float32, Float64, Int, PointTruth

_ECHOES = EchoModel()
_BEYOND_GLASS_M = 0.02
_EGO_VEHICLE = EgoVehicle()


@dataclass(frozen=True)
class LidarScan:
    """N returns and what each of them is.

    Attributes:
        points_velo: (N, 4) points in the LiDAR frame at the frame's time.
        truth: Class, instance and motion of each point.
    """

    points_velo: Float32
    truth: PointTruth


def velo_poses(world: World, sensor: LidarModel, times_s: Float64) -> Float64:
    """Return (K, 4, 4) world_SE3_velo."""
    mount = se3.from_rotation_translation(np.eye(3), np.array([0.0, 0.0, sensor.height_m]))
    return np.asarray(world.world_SE3_body(times_s) @ mount)


def scan(world: World, sensor: LidarModel, time_s: float, rng: np.random.Generator) -> LidarScan:
    """Take one turn of the sensor around a time.

    Raises:
        UsageError: The sensor has no rings.
    """
    if not sensor.has_rings:
        raise UsageError(
            f"sensor {sensor.name}",
            expected="a LiDAR whose beams keep their elevations",
            found="one without rings, whose pattern is not simulated",
            advice="take another sensor for synthetic drives",
        )
    rays, azimuth_rad = _fire(world, sensor, time_s)
    _, moving = world.moving_at(time_s, sensor.max_range_m + 10)
    hits = world.scene.cast(rays, moving)
    hits = _through_glass(world, rays, hits, moving, rng)
    kept, reflectance = _returns(world, sensor, rays, hits, moving, rng)
    kept &= np.abs(azimuth_rad) <= sensor.field_of_view_rad / 2 + 1e-6
    # Beam by beam, each counter-clockwise from straight ahead.
    rays_of_beams = np.arange(len(kept)).reshape(-1, sensor.beams).T
    by_azimuth = np.argsort(np.mod(azimuth_rad[:: sensor.beams], 2 * np.pi), kind="stable")
    ordered = rays_of_beams[:, by_azimuth].ravel()
    order = ordered[kept.take(ordered)]
    range_m = hits.distance_m[order] + rng.normal(0, sensor.range_noise_m, len(order)).astype(
        np.float32
    )
    points = rays.origins_m[order] + range_m[:, None] * rays.directions[order]
    world_SE3_velo = velo_poses(world, sensor, np.array([time_s]))[0]
    rotation = world_SE3_velo[:3, :3].astype(np.float32)
    local = (points - world_SE3_velo[:3, 3].astype(np.float32)) @ rotation
    # The vehicle itself hides the road below; it is not drawn.
    is_seen = ~_EGO_VEHICLE.contains_xy(local)
    local, order = local[is_seen], order[is_seen]
    points_velo = np.concatenate([local, reflectance[order, None]], axis=1)
    moves = np.array([np.linalg.norm(m.velocity_m_s) > MOVING_M_S for m in moving] + [False])
    tables, object_row = world.scene.tables, hits.object_row[order]
    truth = PointTruth(
        tables.classes(hits.row[order], object_row),
        tables.instances[object_row],
        moves[hits.moving[order]],
    )
    return LidarScan(np.ascontiguousarray(points_velo, np.float32), truth)


def _fire(world: World, sensor: LidarModel, time_s: float) -> tuple[Rays, Float32]:
    """Return the rays of one turn, column by column, and their azimuths."""
    columns = sensor.columns
    azimuth = (np.arange(columns) + 0.5) / columns * 2 * np.pi - np.pi
    delays = azimuth / (2 * np.pi * sensor.rate_hz)
    poses = velo_poses(world, sensor, time_s + delays)
    elevation = sensor.elevations_rad
    across = np.stack(
        [
            np.cos(elevation) * np.cos(azimuth)[:, None],
            np.cos(elevation) * np.sin(azimuth)[:, None],
            np.broadcast_to(np.sin(elevation), (columns, len(elevation))),
        ],
        axis=-1,
    )
    directions = across @ poses[:, :3, :3].transpose(0, 2, 1)
    middle = poses[columns // 2]
    columns_of = np.arange(columns)
    beams_of = np.arange(sensor.beams)

    def near(centre_m: Float64, radius_m: float) -> Int:
        offset = middle[:3, :3].T @ (centre_m - middle[:3, 3])
        distance = float(np.linalg.norm(offset))
        if distance < 1.5 * radius_m + 1:
            return np.arange(columns * sensor.beams)
        half = np.arcsin(min(1.0, (radius_m + 0.3) / max(np.hypot(*offset[:2]), 1e-3)))
        turn = np.mod(azimuth - np.arctan2(offset[1], offset[0]) + np.pi, 2 * np.pi) - np.pi
        level = np.arcsin(offset[2] / distance)
        tall = np.arcsin(min(1.0, (radius_m + 0.1) / distance))
        at_column = columns_of[np.abs(turn) <= half]
        at_beam = beams_of[np.abs(elevation - level) <= tall]
        return np.asarray((at_column[:, None] * sensor.beams + at_beam).ravel())

    rays = Rays(
        np.repeat(poses[:, :3, 3].astype(np.float32), sensor.beams, axis=0),
        np.ascontiguousarray(directions.reshape(-1, 3), np.float32),
        np.repeat(delays.astype(np.float32), sensor.beams),
        near,
    )
    return rays, np.repeat(azimuth.astype(np.float32), sensor.beams)


def _through_glass(
    world: World, rays: Rays, hits: Hits, moving: list[MovingObject], rng: np.random.Generator
) -> Hits:
    """Let most shots through glass go on to the surface behind it."""
    slots = world.scene.tables.slots[hits.row]
    passes = rng.random(len(slots), np.float32) < column("transmission")[slots]
    passes &= hits.row >= 0
    index = np.flatnonzero(passes)
    if len(index) == 0:
        return hits
    directions, on = rays.directions[index], hits.distance_m[index] + _BEYOND_GLASS_M
    origins = rays.origins_m[index] + on[:, None] * directions
    onward = Rays(origins, directions, rays.delays_s[index], near_any(origins, directions))
    behind = world.scene.cast(onward, moving)
    merged = {name: getattr(hits, name).copy() for name in vars(hits)}
    for name, values in merged.items():
        values[index] = getattr(behind, name)
    merged["distance_m"][index] += on
    return replace(hits, **merged)


def _returns(
    world: World,
    sensor: LidarModel,
    rays: Rays,
    hits: Hits,
    moving: list[MovingObject],
    rng: np.random.Generator,
) -> tuple[Bool, Float32]:
    """Return which shots have a return, and their reflectance."""
    tables = world.scene.tables
    slots = tables.slots[hits.row]
    normals = world.scene.face_normals(hits, moving)
    cosine = np.abs(np.einsum("ij,ij->i", normals, rays.directions))
    albedo = tables.palettes[hits.object_row, slots, 3]
    albedo = marking_reflectance(world, hits, slots, albedo)
    shots = Shots(albedo, cosine, np.maximum(hits.distance_m, np.float32(1e-3)))
    share = _ECHOES.kept_share(sensor, slots, shots, world.config.absorption)
    kept = rng.random(len(slots), np.float32) < share
    reflectance = _ECHOES.reflectance(sensor, slots, shots, world.sensor_unit, rng)
    return kept & shots.within(sensor), reflectance
