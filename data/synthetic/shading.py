"""Shading: sun and its shadows, sky, occlusion under vehicles and in tunnels, lamps, gloss, haze."""

from dataclasses import dataclass

import cv2
import numpy as np

from data.synthetic.light import Daylight, glow, headlight
from data.synthetic.materials import Slot, column, rgb
from data.synthetic.raycasting import Hits, MovingObject, Rays, near_any
from data.synthetic.rig import PinholeCamera, near_pixels
from data.synthetic.textures import ProceduralTextures
from data.synthetic.world import World
from perception.kernels.rendering import add_gloss, add_haze, mirror_rays, scatter_light
from perception.types import Float32, Float64, Int, UInt8


@dataclass(frozen=True)
class RenderState:
    """State of the world at the time of one image, shared by its bands.

    Attributes:
        pinhole: Pinhole camera at its pose.
        world_SE3_velo: (4, 4) pose of the LiDAR.
        moving: Moving objects in view.
        casting: Moving objects near enough to cast shadows.
        footprints: Pose, length and width of the vehicles nearby.
    """

    pinhole: PinholeCamera
    world_SE3_velo: Float64
    moving: list[MovingObject]
    casting: list[MovingObject]
    footprints: list[tuple[Float64, float, float]]


@dataclass(frozen=True)
class GBuffer:
    """Surfaces behind the pixels of one band.

    Attributes:
        rows: Rows of the image.
        shape: Rows and columns of the band.
        rays: Rays, one per pixel, row by row.
        hits: Hits of the rays.
        seen: (K,) indices of the pixels whose ray meets a surface.
        slots: (K,) material slots.
        points: (K, 3) points in the world.
        normals: (K, 3) unit normals, turned towards the camera.
    """

    rows: slice
    shape: tuple[int, int]
    rays: Rays
    hits: Hits
    seen: Int
    slots: UInt8
    points: Float32
    normals: Float32


_ROUNDED = [
    Slot.PAINT, Slot.GLASS, Slot.TRIM, Slot.TYRE, Slot.RIM, Slot.HEADLIGHT, Slot.TAILLIGHT, Slot.SKIN,
    Slot.HAIR, Slot.SHIRT, Slot.TROUSERS, Slot.SHOES, Slot.BICYCLE, Slot.METAL, Slot.TRUNK, Slot.LEAVES,
]  # fmt: skip
_GROUND = [Slot.ASPHALT, Slot.PAVEMENT, Slot.KERB, Slot.GRASS]
IS_ROUNDED = np.isin(np.arange(len(Slot)), _ROUNDED)
_IS_GROUND = np.isin(np.arange(len(Slot)), _GROUND)
_GLOSS = column("gloss")
_SHADOW_STEP = 2  # shadows are cast for every second pixel of every second row
_UNDER_CARS = 0.05  # share of the sky's light that reaches the ground there
_IN_CROWNS = 0.5  # the same of leaves
_GREY_HAZE = rgb(0.70, 0.76, 0.84)


class Shader:
    """Shades the visible surfaces of one world."""

    def __init__(self, world: World, daylight: Daylight) -> None:
        self._world, self._daylight = world, daylight
        self._textures = ProceduralTextures(world.config.road)
        self._tunnel = world.tunnel
        palettes = world.scene.tables.palettes
        self._colours = np.ascontiguousarray(palettes.reshape(-1, palettes.shape[-1])[:, :3])
        self._exposed = np.ones(len(Slot), np.float32)
        self._exposed[Slot.LEAVES] = _IN_CROWNS

    def shade(self, buffer: GBuffer, state: RenderState) -> Float32:
        """Return (K, 3) the light that reaches the camera from the visible surfaces."""
        tables, daylight = self._world.scene.tables, self._daylight
        object_row = buffer.hits.object_row.take(buffer.seen)
        palette_row = object_row * len(Slot) + buffer.slots.astype(np.int64)
        colours = self._colours.take(palette_row, axis=0)
        colours = self._textures.paint(tables, buffer.hits, buffer.seen, buffer.slots, colours)
        open_sky = self._openness(buffer, state)
        facing = np.clip(buffer.normals @ daylight.sun.astype(np.float32), 0, 1)
        if daylight.is_sunny:
            facing *= self._sunlit(buffer, state) * np.minimum(2 * open_sky, 1)
        ambient = (0.55 + 0.45 * buffer.normals[:, 2]) * open_sky * self._exposed[buffer.slots]
        light = np.empty_like(colours)
        scatter_light(light, colours, facing, ambient, daylight.sun_rgb, daylight.sky_rgb)
        if daylight.level < 1:
            light += colours * headlight(buffer.points, buffer.normals, state.world_SE3_velo)
            is_driving = buffer.hits.moving.take(buffer.seen) >= 0
            light += glow(buffer.slots) * is_driving[:, None]
        self._add_gloss(light, buffer, facing, open_sky)
        distance = buffer.hits.distance_m[buffer.seen]
        haze = 1 - np.exp(-distance / (2500 - 1500 * daylight.haze))
        add_haze(light, haze, np.float32(daylight.level) * _GREY_HAZE)
        return light

    def _sunlit(self, buffer: GBuffer, state: RenderState) -> Float32:
        """Return (K,) how much of the sun reaches each place, from rays for a quarter of the pixels."""
        height, width = buffer.shape
        number = np.full(width * height, -1, np.int64)
        number[buffer.seen] = np.arange(len(buffer.seen))
        coarse = number.reshape(height, width)[::_SHADOW_STEP, ::_SHADOW_STEP]
        asked = coarse[coarse >= 0]
        sun = self._daylight.sun.astype(np.float32)
        faces = buffer.normals[asked] @ sun > 0
        asked_facing = asked[faces]
        # Rounded surfaces consist of flat triangles, which would shade themselves at the rim.
        lift = np.where(IS_ROUNDED[buffer.slots[asked_facing]], np.float32(0.07), np.float32(0.02))
        shift = lift[:, None] * buffer.normals[asked_facing]
        origins = np.asarray(buffer.points[asked_facing] + shift, np.float32)
        directions = np.broadcast_to(sun, origins.shape).copy()
        rays = Rays(
            origins, directions, np.zeros(len(origins), np.float32), near_any(origins, directions)
        )
        blocked = self._world.scene.blocks(rays, state.casting)
        lit = np.ones(len(asked), np.float32)
        lit[np.flatnonzero(faces)[blocked]] = 0.0
        small = np.ones(coarse.shape, np.float32)
        small[coarse >= 0] = lit
        full = cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
        return np.asarray(full.reshape(-1)[buffer.seen])

    def _openness(self, buffer: GBuffer, state: RenderState) -> Float32:
        """Return (K,) the share of the sky that the ground sees beside and under vehicles."""
        open_sky = np.ones(len(buffer.seen), np.float32)
        number = np.full(len(buffer.hits.row), -1, np.int64)
        number[buffer.seen] = np.where(_IS_GROUND[buffer.slots], np.arange(len(buffer.seen)), -1)
        near = near_pixels(state.pinhole, buffer.rows)
        for pose, length, width in state.footprints:
            at = number.take(near(pose[:3, 3], length / 2 + 0.4))
            at = at[at >= 0]
            world_SE3_car = pose.astype(np.float32)
            x, y, z = (
                (buffer.points.take(at, axis=0) - world_SE3_car[:3, 3]) @ world_SE3_car[:3, :3]
            ).T
            outside = np.maximum(np.abs(x) - length / 2, np.abs(y) - width / 2)
            level = np.abs(z) < 0.3
            shade = np.clip((outside + 0.25) / 0.75, 0, 1)
            open_sky[at] *= np.where(level, _UNDER_CARS + (1 - _UNDER_CARS) * np.sqrt(shade), 1.0)
        if self._tunnel:
            open_sky *= self._tunnel.daylight_share(buffer.points)
        return open_sky

    def _add_gloss(
        self, light: Float32, buffer: GBuffer, facing: Float32, open_sky: Float32
    ) -> None:
        """Add what paint, glass and metal mirror, more at grazing angles, and the sun's glint."""
        at = np.flatnonzero(_GLOSS.take(buffer.slots))
        gloss = _GLOSS.take(buffer.slots.take(at))
        directions = buffer.rays.directions.take(buffer.seen.take(at), axis=0)
        cosine = np.einsum("ij,ij->i", directions, buffer.normals.take(at, axis=0))
        mirrored = np.empty_like(directions)
        mirror_rays(mirrored, at, directions, buffer.normals, cosine)
        strength = gloss + (0.55 - 0.5 * gloss) * (1 - np.abs(cosine)) ** 5
        glint = np.clip(mirrored @ self._daylight.sun.astype(np.float32), 0, 1) ** 180
        glint *= facing.take(at) > 0
        around = self._daylight.mirrored(mirrored, buffer.points.take(at, axis=0))
        if self._tunnel:
            strength *= open_sky.take(at)
        add_gloss(light, at, strength, around, glint, self._daylight.sun_rgb)
