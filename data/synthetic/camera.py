"""The colour camera: rays through pixels, shaded by sun and sky, shadows cast, and a sensor's noise."""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from data.synthetic.light import Daylight
from data.synthetic.materials import Slot, column, rgb
from data.synthetic.rig import IMAGE_SIZE_PX, PinholeCamera
from data.synthetic.scene import Hits, Moving, Rays, near_any, rotated
from data.synthetic.textures import Painter, grain
from data.synthetic.world import World
from perception.types import Calibration, Float32, Float64, Int, UInt8

_ROUNDED = [
    Slot.PAINT, Slot.GLASS, Slot.TRIM, Slot.TYRE, Slot.RIM, Slot.HEADLIGHT, Slot.TAILLIGHT, Slot.SKIN,
    Slot.HAIR, Slot.SHIRT, Slot.TROUSERS, Slot.SHOES, Slot.BICYCLE, Slot.METAL, Slot.TRUNK, Slot.LEAVES,
]  # fmt: skip
_GROUND = [Slot.ASPHALT, Slot.PAVEMENT, Slot.KERB, Slot.GRASS]
_IS_ROUNDED = np.isin(np.arange(len(Slot)), _ROUNDED)
_IS_GROUND = np.isin(np.arange(len(Slot)), _GROUND)
_SHADOW_STEP = 2  # shadows are cast for every second pixel of every second row
_BAND_ROWS = 76  # the image is made in bands of rows, whose arrays stay in the processor's cache
_VIEW_M = 160.0
_OPENNESS_M = 45.0  # farther vehicles do not visibly darken the ground around them
_SHADOWS_M = 70.0  # farther moving things cast none


@dataclass(frozen=True)
class Exposure:
    """What the camera does to light.

    Attributes:
        gain: of the light.
        noise: standard deviation of the sensor's noise at mid grey, in grey levels of 255.
        blur_px: of the lens.
    """

    gain: float = 1.0
    noise: float = 1.6
    blur_px: float = 0.55


@dataclass(frozen=True)
class _Moment:
    """What is the same for all bands of one image.

    Attributes:
        pinhole: the camera in its place.
        velo_to_world: (3, 3) rotation of the LiDAR.
        moving: what moves in view.
        casting: those of it near enough to cast shadows.
        footprints: pose, length and width of the vehicles around.
    """

    pinhole: PinholeCamera
    velo_to_world: Float32
    moving: list[Moving]
    casting: list[Moving]
    footprints: list[tuple[Float64, float, float]]


@dataclass(frozen=True)
class _View:
    """What the pixels of one band see.

    Attributes:
        shape: rows and columns of the band.
        rays: one a pixel, row by row.
        hits: where they end.
        seen: (K,) pixels that see something.
        slots: (K,) material.
        points: (K, 3) in the world.
        normals: (K, 3) towards the camera.
    """

    shape: tuple[int, int]
    rays: Rays
    hits: Hits
    seen: Int
    slots: UInt8
    points: Float32
    normals: Float32


class Camera:
    """A colour camera in one world."""

    def __init__(self, world: World, calibration: Calibration, daylight: Daylight) -> None:
        """Prepare what does not change from frame to frame."""
        self._world, self._calibration, self._daylight = world, calibration, daylight
        self._painter = Painter(world.config.road)
        width, height = calibration.image_size_px or IMAGE_SIZE_PX
        pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1)
        level = PinholeCamera(calibration, np.eye(4))
        self._directions_velo = level.rays(pixels.reshape(-1, 2).astype(float)).directions

    def take(
        self, world_SE3_velo: Float64, time_s: float, exposure: Exposure, rng: np.random.Generator
    ) -> UInt8:
        """Return the (H, W, 3) image at a time, the LiDAR being at a pose."""
        moment = self._moment(world_SE3_velo, time_s)
        width, height = moment.pinhole.size_px
        bands = [
            self._band(moment, slice(first, min(first + _BAND_ROWS, height)))
            for first in range(0, height, _BAND_ROWS)
        ]
        return develop(np.concatenate(bands).reshape(height, width, 3), exposure, rng)

    def _moment(self, world_SE3_velo: Float64, time_s: float) -> _Moment:
        pinhole = PinholeCamera(self._calibration, world_SE3_velo)
        _, moving = self._world.moving_at(time_s, _VIEW_M)
        casting = [
            thing
            for thing in moving
            if np.linalg.norm(thing.world_SE3_thing[:3, 3] - pinhole.centre_m) < _SHADOWS_M
        ]
        footprints = self._world.footprints(moving, pinhole.centre_m, _OPENNESS_M)
        rotation = world_SE3_velo[:3, :3].astype(np.float32)
        return _Moment(pinhole, rotation, moving, casting, footprints)

    def _band(self, moment: _Moment, rows: slice) -> Float32:
        """Return (rows * W, 3) the light that some rows of pixels receive."""
        view = self._look(moment, rows)
        light = np.empty((len(view.hits.row), 3), np.float32)
        missed = np.flatnonzero(view.hits.row < 0)
        light[missed] = self._daylight.sky(view.rays.directions[missed])
        light[view.seen] = self._shade(view, moment, rows)
        return light

    def _look(self, moment: _Moment, rows: slice) -> _View:
        """Cast the rays of a band of pixels and gather what they meet."""
        width = moment.pinhole.size_px[0]
        pixels = slice(rows.start * width, rows.stop * width)
        directions = self._directions_velo[pixels] @ moment.velo_to_world.T
        origins = np.empty_like(directions)
        origins[:] = moment.pinhole.centre_m
        delays = np.zeros(len(directions), np.float32)
        rays = Rays(origins, directions, delays, near_pixels(moment.pinhole, rows))
        hits = self._world.scene.cast(rays, moment.moving)
        seen = np.flatnonzero(hits.row >= 0)
        tables = self._world.scene.tables
        directions = rays.directions[seen]
        slots = tables.slots[hits.row[seen]]
        points = rays.origins_m[seen] + hits.distance_m[seen, None] * directions
        normals = self._normals(hits, seen, slots, moment.moving)
        normals *= -np.sign(np.einsum("ij,ij->i", normals, directions))[:, None]
        shape = (rows.stop - rows.start, width)
        return _View(shape, rays, hits, seen, slots, points, normals)

    def _normals(self, hits: Hits, seen: Int, slots: UInt8, moving: list[Moving]) -> Float32:
        """Return unit normals, interpolated over rounded things."""
        tables = self._world.scene.tables
        normals = np.zeros((len(hits.row), 3), np.float32)
        normals[seen] = np.take(tables.face_normals, hits.row[seen], axis=0)
        rounded = seen[_IS_ROUNDED[slots]]
        corners = np.take(tables.corner_normals, hits.row[rounded], axis=0)
        u, v = hits.u[rounded, None], hits.v[rounded, None]
        mixed = corners[:, 0] * (1 - u - v) + corners[:, 1] * u + corners[:, 2] * v
        mixed /= np.maximum(np.linalg.norm(mixed, axis=1, keepdims=True), 1e-6)
        normals[rounded] = mixed
        return rotated(normals, hits, moving)[seen]

    def _shade(self, view: _View, moment: _Moment, rows: slice) -> Float32:
        """Return (K, 3) the light that reaches the camera from all that is seen."""
        tables, daylight = self._world.scene.tables, self._daylight
        thing = view.hits.thing[view.seen]
        colours = np.take(
            tables.palettes.reshape(-1, 4), thing * len(Slot) + view.slots.astype(np.int64), axis=0
        )[:, :3]
        colours = self._painter.paint(tables, view.hits, view.seen, view.slots, colours)
        colours = _leafy(colours, view)
        facing = np.clip(view.normals @ daylight.sun.astype(np.float32), 0, 1)
        if daylight.is_sunny:
            facing *= self._sunlit(view, moment)
        up = view.normals[:, 2]
        ambient = (0.62 + 0.38 * up) * self._openness(view, moment, rows)
        light = colours * (facing[:, None] * daylight.sun_rgb + ambient[:, None] * daylight.sky_rgb)
        light = self._gloss(light, view, facing)
        distance = view.hits.distance_m[view.seen]
        haze = (1 - np.exp(-distance / 2500))[:, None]
        return np.asarray(light + haze * (rgb(0.70, 0.76, 0.84) - light), np.float32)

    def _sunlit(self, view: _View, moment: _Moment) -> Float32:
        """Return (K,) how much of the sun reaches each place, from rays for a quarter of the pixels."""
        height, width = view.shape
        number = np.full(width * height, -1, np.int64)
        number[view.seen] = np.arange(len(view.seen))
        coarse = number.reshape(height, width)[::_SHADOW_STEP, ::_SHADOW_STEP]
        asked = coarse[coarse >= 0]
        sun = self._daylight.sun.astype(np.float32)
        faces = view.normals[asked] @ sun > 0
        asked_facing = asked[faces]
        # Rounded things are made of flat triangles, which would shade themselves at the rim.
        lift = np.where(_IS_ROUNDED[view.slots[asked_facing]], np.float32(0.07), np.float32(0.02))
        shift = lift[:, None] * view.normals[asked_facing]
        origins = np.asarray(view.points[asked_facing] + shift, np.float32)
        directions = np.broadcast_to(sun, origins.shape).copy()
        rays = Rays(
            origins, directions, np.zeros(len(origins), np.float32), near_any(origins, directions)
        )
        blocked = self._world.scene.blocks(rays, moment.casting)
        lit = np.ones(len(asked), np.float32)
        lit[np.flatnonzero(faces)[blocked]] = 0.0
        small = np.ones(coarse.shape, np.float32)
        small[coarse >= 0] = lit
        full = cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
        return np.asarray(full.reshape(-1)[view.seen])

    def _openness(self, view: _View, moment: _Moment, rows: slice) -> Float32:
        """Return (K,) the share of the sky that the ground sees beside and under vehicles."""
        open_sky = np.ones(len(view.seen), np.float32)
        number = np.full(len(view.hits.row), -1, np.int64)
        number[view.seen] = np.where(_IS_GROUND[view.slots], np.arange(len(view.seen)), -1)
        near = near_pixels(moment.pinhole, rows)
        for pose, length, width in moment.footprints:
            at = number[near(pose[:3, 3], length / 2 + 0.4)]
            at = at[at >= 0]
            world_SE3_car = pose.astype(np.float32)
            x, y, z = ((view.points[at] - world_SE3_car[:3, 3]) @ world_SE3_car[:3, :3]).T
            outside = np.maximum(np.abs(x) - length / 2, np.abs(y) - width / 2)
            level = np.abs(z) < 0.3
            shade = np.clip((outside + 0.25) / 0.75, 0, 1)
            open_sky[at] *= np.where(level, 0.22 + 0.78 * np.sqrt(shade), 1.0)
        return open_sky

    def _gloss(self, light: Float32, view: _View, facing: Float32) -> Float32:
        """Add what paint, glass and metal mirror, more at grazing angles, and the sun's glint."""
        gloss = column("gloss")[view.slots]
        at = np.flatnonzero(gloss > 0)
        directions, normals = view.rays.directions[view.seen[at]], view.normals[at]
        cosine = np.einsum("ij,ij->i", directions, normals)
        mirrored = directions - 2 * cosine[:, None] * normals
        strength = gloss[at] + (0.55 - 0.5 * gloss[at]) * (1 - np.abs(cosine)) ** 5
        glint = np.clip(mirrored @ self._daylight.sun.astype(np.float32), 0, 1) ** 180
        glossy = light.copy()
        sun = (glint * (facing[at] > 0))[:, None] * self._daylight.sun_rgb
        glossy[at] += strength[:, None] * (self._daylight.mirrored(mirrored) + 3.0 * sun)
        return glossy


def _leafy(colours: Float32, view: _View) -> Float32:
    """Give every leaf its own tone."""
    tones = colours.copy()
    leaves = np.flatnonzero(view.slots == Slot.LEAVES)
    row = view.hits.row[view.seen[leaves]].astype(np.float32)
    tones[leaves] *= np.clip(1 + 0.35 * grain(row, row / 512), 0.3, 2.2)[:, None]
    return tones


def near_pixels(pinhole: PinholeCamera, band: slice) -> Callable[[Float64, float], Int]:
    """Return a search for the pixels of a band of rows that may see a sphere."""
    width, height = pinhole.size_px
    row_start = np.arange(band.stop - band.start)[:, None] * width
    empty = np.zeros(0, np.int64)

    def near(centre_m: Float64, radius_m: float) -> Int:
        x, y, z = pinhole.camera_R_world @ (centre_m - pinhole.centre_m)
        columns = _span(x, z, radius_m, pinhole.focal_px, pinhole.middle_px[0], width)
        rows = _span(y, z, radius_m, pinhole.focal_px, pinhole.middle_px[1], height)
        first, last = max(rows.start, band.start), min(rows.stop, band.stop)
        if first >= last or columns.start >= columns.stop:
            return empty
        inside = row_start[first - band.start : last - band.start]
        return np.asarray((inside + np.arange(columns.start, columns.stop)).ravel())

    return near


def _span(
    across_m: float,
    ahead_m: float,
    radius_m: float,
    focal_px: float,
    middle_px: float,
    size_px: int,
) -> slice:
    """Return the pixels along one axis that a circle before the camera covers."""
    distance = float(np.hypot(across_m, ahead_m))
    if distance <= radius_m:
        return slice(0, size_px)
    middle, half = np.arctan2(across_m, ahead_m), np.arcsin(radius_m / distance)
    if middle - half > 1.5 or middle + half < -1.5:
        return slice(0, 0)
    edges = middle_px + focal_px * np.tan(np.clip([middle - half, middle + half], -1.55, 1.55))
    low, high = np.clip([edges[0] - 1, edges[1] + 2], 0, size_px).astype(int)
    return slice(low, high)


def develop(light: Float32, exposure: Exposure, rng: np.random.Generator) -> UInt8:
    """Turn light into an image: lens blur, vignette, exposure, gamma, noise."""
    height, width = light.shape[:2]
    blurred = cv2.GaussianBlur(light, (0, 0), exposure.blur_px) if exposure.blur_px > 0 else light
    y, x = np.ogrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    vignette = (exposure.gain * (1 - 0.10 * (x * x + 0.4 * y * y))).astype(np.float32)
    exposed = np.maximum(blurred * vignette[..., None], 0)
    # A shoulder keeps highlights from clipping at once; then the display's gamma by a table.
    shoulder = exposed / (1 + 0.35 * exposed) * 1.35 * 0.72
    tone = np.linspace(0, 1, 4096) ** (1 / 2.2)
    table = (255 * (0.5 * tone + 0.5 * tone**2 * (3 - 2 * tone))).astype(np.float32)
    levels = np.take(table, np.minimum(shoulder * 4095, 4095).astype(np.int32))
    noise = rng.standard_normal((height, width), np.float32) * np.float32(exposure.noise)
    speckled = levels + noise[..., None] + (noise[:, ::-1, None] * rgb(0.5, -0.2, 0.6))
    return np.asarray(np.clip(speckled + 0.5, 0, 255), np.uint8)
