"""Procedural textures of roads, walls and vehicles, from texture coordinates; and road markings."""

from collections.abc import Callable

import numpy as np

from data.synthetic.materials import Slot, rgb
from data.synthetic.raycasting import Hits, SurfaceTables
from data.synthetic.road import RoadShape
from data.synthetic.vehicle_bodies import END_U, SILL_V, VARIANT_V
from data.synthetic.world import World
from perception.kernels.rendering import look_up, look_up_between, texture_coordinates
from perception.types import Bool, Float, Float32, Int, UInt8

_SIZE = 512
_PAINT_REFLECTANCE = 0.62


def _fractal_noise(seed: int) -> Float32:
    """Return a noise image that tiles, of many scales, with mean 0 and deviation 1."""
    waves = np.fft.fftfreq(_SIZE) * _SIZE
    radius = np.maximum(np.hypot(waves[:, None], waves[None]), 1.0)
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, radius.shape)
    image = np.fft.ifft2(np.exp(1j * phases) / radius**1.1).real
    # Releases of NumPy differ about the order of the axes in memory.
    return np.ascontiguousarray((image - image.mean()) / image.std(), np.float32)


_NOISE = _fractal_noise(5)
_GRAIN = np.random.default_rng(6).normal(0, 1, (_SIZE, _SIZE)).astype(np.float32)


def smooth_noise(x: Float, y: Float) -> Float32:
    """Look up noise of many scales; it repeats after 512 units."""
    values = np.empty(len(x), np.float32)
    look_up(values, _NOISE, x.copy(), y.copy())
    return values


def grain(x: Float, y: Float) -> Float32:
    """Look up white noise, constant within a unit square."""
    values = np.empty(len(x), np.float32)
    look_up(values, _GRAIN, x.copy(), y.copy())
    return values


def clouds(x: Float, y: Float) -> Float32:
    """Look up noise of many scales, interpolated between its samples."""
    values = np.empty(len(x), np.float32)
    look_up_between(values, _NOISE, x.copy(), y.copy())
    return values


def texture_at(tables: SurfaceTables, hits: Hits, rows: Int) -> Float32:
    """Return (K, 2) texture coordinates of some hits."""
    places = np.empty((len(rows), 2), np.float32)
    texture_coordinates(places, rows, hits.row, tables.texture_m, hits.u, hits.v)
    return places


def is_marking(shape: RoadShape, s_m: Float32, l_m: Float32) -> Bool:
    """Tell where the road is painted: a dashed centreline, and lines along the parking lanes."""
    side = np.abs(l_m)
    # Dashes between lanes, the centreline's among them.
    from_line = np.abs(np.mod(side + shape.lane_m / 2, shape.lane_m) - shape.lane_m / 2)
    dash = (np.mod(s_m, 9.0) < 3.0) & (from_line < 0.06) & (side < shape.lanes_m - 1)
    if shape.parking_m < 1.0:
        return np.asarray(dash | (np.abs(side - shape.half_width_m + 0.25) < 0.05))
    edge = (np.abs(side - shape.lanes_m) < 0.05) & (np.mod(s_m, 2.0) < 1.0)
    bay = (np.mod(s_m, 5.6) < 0.09) & (side > shape.lanes_m)
    return np.asarray(dash | edge | bay)


def marking_reflectance(world: World, hits: Hits, slots: UInt8, albedo: Float32) -> Float32:
    """Raise the reflectance of road markings."""
    road = np.flatnonzero((slots == Slot.ASPHALT) & (hits.row >= 0))
    place = texture_at(world.scene.tables, hits, road)
    painted = is_marking(world.config.road, place[:, 0], place[:, 1])
    raised = albedo.copy()
    raised[road[painted]] = _PAINT_REFLECTANCE
    return raised


_PLASTIC, _CHROME = rgb(0.025, 0.025, 0.027), rgb(0.45, 0.46, 0.48)
_HANDLES_M = (-0.05, -1.05)  # rear edges of the front and rear doors' handles


def panel(place: Float32, colours: Float32, fade: Float32) -> Float32:
    """Return (K, 3) the colours of painted panels at texture coordinates."""
    drawn = colours.copy()
    at = np.flatnonzero(place[:, 1] >= VARIANT_V)
    u, v = place[at, 0], place[at, 1]
    variant, share = (v // VARIANT_V).astype(np.int32), np.mod(v, VARIANT_V) - SILL_V
    is_end = u > END_U / 2
    # Light breaks at a crease below the waist; dirt lies on what is low.
    crease = share - 0.74
    tone = 1 + 0.16 * np.tanh(25 * crease) * np.exp(-np.square(crease / 0.16))
    tone *= 1 - 0.35 * np.exp(-np.maximum(share, 0) / 0.14)
    gap = np.where(is_end, np.abs(share - 0.47) < 0.022, False)
    gap |= is_end & (np.abs(np.abs(u - END_U) - 0.60) < 0.012) & (share > 0.5)
    tone = np.where(gap, 0.3 * tone, tone)
    finished = colours[at] * tone[:, None]
    has_strip, has_sill, has_chrome = (variant & bit > 0 for bit in (1, 2, 4))
    plastic = has_strip & (np.abs(share - 0.42) < 0.045)
    plastic |= has_sill & (share < 0.20)
    handles = _are_handles(u, share) & ~is_end
    badge = is_end & (np.hypot((u - END_U) / 0.06, (share - 0.86) / 0.075) < 1)
    finished[plastic | (handles & ~has_chrome)] = _PLASTIC
    finished[badge | (handles & has_chrome)] = _CHROME
    drawn[at] = finished
    return drawn


def _are_handles(u: Float32, share: Float32) -> Bool:
    level = np.abs(share - 0.84) < 0.03
    return np.asarray(level & np.any([np.abs(u - at - 0.09) < 0.09 for at in _HANDLES_M], axis=0))


def pane(place: Float32, colours: Float32, fade: Float32) -> Float32:
    """Texture a pane with the seats and windows behind it."""
    behind = clouds(place[:, 0] * 9, place[:, 1] * 14)
    shown = 1 + 0.5 * behind + 5 * np.clip(behind - 1.1, 0, 0.6)
    return np.asarray(colours * np.maximum(shown, 0.2)[:, None], np.float32)


class ProceduralTextures:
    """Textures of all materials; one for each world, as road markings belong to a road."""

    def __init__(self, road: RoadShape) -> None:
        self._road = road
        self._patterns: dict[Slot, Callable[[Float32, Float32, Float32], Float32]] = {
            Slot.ASPHALT: self._asphalt,
            Slot.PAVEMENT: _paving,
            Slot.KERB: _kerb,
            Slot.GRASS: _grass,
            Slot.WALL: _wall,
            Slot.ROOF: _tiles,
            Slot.SIGN: _sign,
            Slot.FENCE: _planks,
            Slot.LEAVES: _leaves,
            Slot.PLATE: _plate,
            Slot.PAINT: panel,
            Slot.GLASS: pane,
        }

    def paint(
        self, tables: SurfaceTables, hits: Hits, rows: Int, slots: UInt8, colours: Float32
    ) -> Float32:
        """Return (K, 3) textured colours of some hits."""
        painted = colours.copy()
        for slot, pattern in self._patterns.items():
            at = np.flatnonzero(slots == slot)
            if len(at):
                indices = rows.take(at)
                place = texture_at(tables, hits, indices)
                distance_m = hits.distance_m.take(indices)
                fade = np.float32(1) / (1 + np.square(distance_m / np.float32(22)))
                painted[at] = pattern(place, colours.take(at, axis=0), fade)
        return painted

    def _asphalt(self, place: Float32, colours: Float32, fade: Float32) -> Float32:
        s, side = place[:, 0], place[:, 1]
        tone = 1 + 0.07 * smooth_noise(s * 2, side * 6) + 0.16 * fade * grain(s * 60, side * 60)
        # Patches of newer tar, ruts polished by wheels, oil between them, seams and cracks.
        tone += np.float32(0.10) * np.clip(np.abs(grain(s / 9, side / 1.75)) - 1, 0, 1.5)
        lane = np.mod(side, self._road.lane_m) / self._road.lane_m
        tone += 0.06 * np.sin(4 * np.pi * lane) ** 2 * (np.abs(side) < self._road.lanes_m) - 0.04
        tone -= 0.10 * np.exp(-np.square((lane - 0.5) / 0.09)) * (0.6 + 0.4 * smooth_noise(s, side))
        seam = np.abs(side + 0.25 + 0.05 * np.sin(s * 0.9) * np.sin(s * 0.37)) < 0.025
        crack = np.abs(clouds(s * 3 + 99, side * 3) - 0.9) < 0.03 * np.sqrt(fade)
        tone = np.where(seam | crack, 0.5 * tone, tone)
        toned = np.asarray(colours * tone[:, None], np.float32)
        painted = np.flatnonzero(is_marking(self._road, s, side))
        wear = 0.85 + 0.10 * smooth_noise(s[painted] * 25, side[painted] * 25)
        toned[painted] = np.clip(0.62 * wear, 0.2, 0.75)[:, None]
        return toned


def _paving(place: Float32, colours: Float32, fade: Float32) -> Float32:
    s, side = place[:, 0] / 0.4, place[:, 1] / 0.4
    tone = 1 + 0.10 * grain(s, side) * np.sqrt(fade) + 0.06 * smooth_noise(s, side)
    joint = (np.mod(s, 1) < 0.05) | (np.mod(side, 1) < 0.05)
    return np.asarray(colours * np.where(joint, 1 - 0.4 * np.sqrt(fade), tone)[:, None], np.float32)


def _kerb(place: Float32, colours: Float32, fade: Float32) -> Float32:
    joint = np.mod(place[:, 0], 1.0) < 0.02
    tone = 1 + 0.10 * smooth_noise(place[:, 0] * 20, place[:, 1] * 60)
    return np.asarray(colours * np.where(joint, 1 - 0.5 * fade, tone)[:, None], np.float32)


def _grass(place: Float32, colours: Float32, fade: Float32) -> Float32:
    x, y = place[:, 0], place[:, 1]
    tone = 1 + 0.22 * smooth_noise(x * 4, y * 4) + 0.30 * fade * grain(x * 45, y * 45)
    dry = np.clip(0.5 + 0.4 * smooth_noise(x * 1.5 + 77, y * 1.5), 0, 1)[:, None]
    mixed = colours * (1 - 0.35 * dry) + rgb(0.20, 0.17, 0.07) * 0.35 * dry
    return np.asarray(np.maximum(mixed * tone[:, None], 0.01), np.float32)


def _wall(place: Float32, colours: Float32, fade: Float32) -> Float32:
    x, z = place[:, 0], place[:, 1]
    stain = 0.07 * smooth_noise(x * 12, z * 4) - 0.10 * np.clip(1 - z / 0.8, 0, 1)
    plaster = 1 + stain + 0.05 * fade * grain(x * 50, z * 50)
    course = np.floor(z / 0.08)
    shift = x / 0.25 + 0.5 * np.mod(course, 2)
    joint = (np.mod(z / 0.08, 1) < 0.14) | (np.mod(shift, 1) < 0.06)
    brick = (1 + 0.16 * grain(shift, course)) * np.where(joint, 1 + 0.5 * fade, 1.0) + stain
    is_brick = colours[:, 0] > 2.2 * colours[:, 2]
    return np.asarray(colours * np.where(is_brick, brick, plaster)[:, None], np.float32)


def _tiles(place: Float32, colours: Float32, fade: Float32) -> Float32:
    x, y = place[:, 0] / 0.25, place[:, 1] / 0.3
    tone = 1 + 0.15 * grain(x, y) - 0.35 * fade * (np.mod(y, 1) < 0.15)
    return np.asarray(colours * tone[:, None], np.float32)


def _leaves(place: Float32, colours: Float32, fade: Float32) -> Float32:
    """Break the cards of a crown into small leaves of several tones, dark gaps between them."""
    x, y = place[:, 0], place[:, 1]
    near = np.sqrt(fade)
    tone = 1 + 0.45 * grain(x * 5, y * 5) + 0.45 * near * grain(x * 22, y * 22)
    gap = smooth_noise(x * 60, y * 60) < -0.5
    tone = np.clip(np.where(gap, 1 - 0.75 * near, tone), 0.12, 2.2)
    return np.asarray(colours * tone[:, None], np.float32)


def _planks(place: Float32, colours: Float32, fade: Float32) -> Float32:
    tone = 1 + 0.12 * smooth_noise(place[:, 0] * 60, place[:, 1] * 8)
    return np.asarray(colours * tone[:, None], np.float32)


def _plate(place: Float32, colours: Float32, fade: Float32) -> Float32:
    """A blue band and seven dark letters."""
    x, z = place[:, 0], place[:, 1]
    letter = (x - 0.12) / 0.125
    stroke = (np.mod(letter, 1) > 0.2) & (np.abs(z - 0.5) < 0.33) & (x > 0.12) & (x < 0.96)
    stroke &= grain(letter * 4, z * 4 + 31) > -0.3
    band = (x < 0.08)[:, None]
    inked = np.where(stroke[:, None], colours * 0.08, colours)
    return np.where(band, rgb(0.01, 0.04, 0.30), inked)


def _sign(place: Float32, colours: Float32, fade: Float32) -> Float32:
    """Red rims on white signs, white symbols on coloured ones."""
    reach = np.hypot(place[:, 0], place[:, 1])
    is_white = (colours.min(axis=1) > 0.5)[:, None]
    red, white, black = rgb(0.5, 0.01, 0.01), rgb(0.75, 0.75, 0.75), rgb(0.02, 0.02, 0.02)
    symbol = ((np.abs(place[:, 0]) < 0.12) & (np.abs(place[:, 1]) < 0.4))[:, None]
    rim = (reach > 0.72)[:, None]
    on_white = np.where(rim, red, np.where(symbol, black, colours))
    return np.where(is_white, on_white, np.where(symbol, white, colours))
