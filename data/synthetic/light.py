"""Light of sun, sky, clouds and lamps, the skyline, and the reflections of glossy surfaces."""

from dataclasses import dataclass, replace

import numpy as np

from data.synthetic.materials import Slot, rgb
from data.synthetic.textures import clouds, grain
from perception.types import Float32, Float64, UInt8

# Two low beams: places in the LiDAR frame, light at 1 m, and the slopes of the beams' upper edge and of their fall below it.
_LAMPS_VELO_M = np.array([[1.6, 0.65, -1.05], [1.6, -0.65, -1.05]])
_BEAM = 90.0 * rgb(1.0, 0.95, 0.86)
_CUTOFF, _FALL = -0.008, 0.10
_SPREAD = 0.45  # sine of the angle to the side at which a third of the light is left
_ABOVE = 0.012  # share of the light that goes above the edge
_GLOW = {Slot.HEADLIGHT: rgb(4.0, 3.8, 3.4), Slot.TAILLIGHT: rgb(0.5, 0.02, 0.015)}
_ZENITH = rgb(0.16, 0.40, 0.95)
_HORIZON = rgb(0.95, 1.08, 1.18)
_CLOUD = rgb(1.7, 1.7, 1.7)
_GREY_SKY = rgb(1.3, 1.33, 1.36)
_TREES = rgb(0.035, 0.055, 0.022)
_SUN, _SKYLIGHT, _OVERCAST = rgb(2.5, 2.36, 2.12), rgb(0.28, 0.35, 0.48), rgb(1.35, 1.40, 1.46)
_BLUE_FROM = 0.32  # sine of the height at which a clear sky is as blue as overhead
_CROWNS_1_RAD = 24.0
_MIRRORED_AT_M = 15.0  # distance at which a street is mirrored
# Light of a night's sky in the country and over a town, relative to an overcast day's.
_NIGHT = (1e-4, 3e-3)


def headlight(points_m: Float32, normals: Float32, world_SE3_velo: Float64) -> Float32:
    """Return (K, 3) the light of the headlights that falls on surfaces.

    Args:
        points_m: (K, 3) places in the world.
        normals: (K, 3) their unit normals.
        world_SE3_velo: (4, 4) pose of the LiDAR.
    """
    light = np.zeros((len(points_m), 3), np.float32)
    rotation = world_SE3_velo[:3, :3].astype(np.float32)
    for lamp_velo_m in _LAMPS_VELO_M:
        lamp_m = (world_SE3_velo[:3, :3] @ lamp_velo_m + world_SE3_velo[:3, 3]).astype(np.float32)
        away = points_m - lamp_m
        distance = np.maximum(np.linalg.norm(away, axis=1), np.float32(0.5))
        towards = away / distance[:, None]
        ahead, left, up = (towards @ rotation).T
        over = np.maximum(up - np.float32(_CUTOFF), 0)
        under = np.minimum(up - np.float32(_CUTOFF), 0)
        beam = np.exp(under / np.float32(_FALL) - (left / np.float32(_SPREAD)) ** 2)
        beam *= np.maximum(np.exp(-over / np.float32(0.006)), np.float32(_ABOVE)) * (ahead > 0)
        facing = np.maximum(-np.einsum("ij,ij->i", towards, normals), 0)
        light += (beam * facing / distance**2)[:, None] * _BEAM
    return light


def glow(slots: UInt8) -> Float32:
    """Return (K, 3) the light of lamps that are seen themselves."""
    table = np.zeros((len(Slot), 3), np.float32)
    for slot, light in _GLOW.items():
        table[slot] = light
    return table[slots]


@dataclass(frozen=True)
class Daylight:
    """The light of one drive.

    Attributes:
        sun: (3,) unit vector towards the sun.
        is_sunny: Whether the sun shines.
        cloud_shift: Offset of the clouds in texture units.
        strength: Light of the sun relative to the usual.
        haze: Share of white in the sky, 0 for deep blue.
        cover: Cloudiness in standard deviations; positive where more of the sky is cloud than is clear.
        skyline: Sine of the height of the trees at the horizon.
        surround: Sine of the height up to which glossy surfaces mirror a street and not its sky.
        level: Light of sun and sky relative to that of the day; below one, lamps are on.
    """

    sun: Float64
    is_sunny: bool
    cloud_shift: float
    strength: float = 1.0
    haze: float = 0.3
    cover: float = 0.1
    skyline: float = 0.012
    surround: float = 0.25
    level: float = 1.0

    @property
    def sun_rgb(self) -> Float32:
        """Light of the sun on a surface that faces it."""
        low = 1 - float(self.sun[2])
        warm = np.float32(self.strength) * (_SUN - low * rgb(0.0, 0.3, 0.7))
        return np.asarray(self.level * warm if self.is_sunny else 0 * _SUN, np.float32)

    @property
    def sky_rgb(self) -> Float32:
        """Light of the whole sky on a surface that faces up."""
        clear = _SKYLIGHT * np.float32(0.8 + 0.8 * self.haze)
        return np.asarray(self.level * (clear if self.is_sunny else _OVERCAST), np.float32)

    def sky(self, directions: Float32) -> Float32:
        """Return (N, 3) light along directions that hit no surface: sky, clouds, distant trees."""
        if self.level != 1:
            return np.float32(self.level) * self._by_day.sky(directions)
        rise = directions[:, 2]
        light = self._clear(directions)
        span = 1 / np.maximum(rise + 0.12, 0.05)
        x, y = directions[:, 0] * span * 40 + self.cloud_shift, directions[:, 1] * span * 40
        thick = clouds(x, y) + self.cover
        if self.is_sunny:
            amount = np.clip(thick * 0.6, 0, 0.9)[:, None]
            light += amount * (_CLOUD - light)
        else:
            light *= (1 + 0.06 * thick)[:, None]
        low = np.flatnonzero(rise < 4 * self.skyline + 0.02)
        light[low] = self._skyline(directions[low], light[low])
        return light

    def _clear(self, directions: Float32) -> Float32:
        """Return (N, 3) the sky without its clouds: white at the horizon and about the sun."""
        height = np.clip(directions[:, 2], 0.0, 1.0)
        if not self.is_sunny:
            return np.asarray(_GREY_SKY * (0.85 + 0.15 * height)[:, None], np.float32)
        haze = np.float32(self.haze)
        zenith = _ZENITH + haze * (_HORIZON - _ZENITH)
        blue = np.minimum(height / np.float32(_BLUE_FROM), 1) ** np.float32(0.6)
        glow = np.maximum(directions @ self.sun.astype(np.float32), 0) ** 5
        light = _HORIZON + blue[:, None] * (zenith - _HORIZON)
        return np.asarray(light * (1 + (0.4 + 1.6 * haze) * glow)[:, None], np.float32)

    def _skyline(self, directions: Float32, behind: Float32) -> Float32:
        """Put trees, pale with distance, before a low part of the sky."""
        azimuth, rise = np.arctan2(directions[:, 1], directions[:, 0]), directions[:, 2]
        shift = self.cloud_shift
        # A row of crowns, each as wide as its share of the horizon, some low and some tall.
        place = azimuth * _CROWNS_1_RAD + clouds(azimuth * 300, 0 * azimuth + shift) * np.float32(
            0.3
        )
        crown = 0.75 + 0.25 * np.clip(grain(place, 0 * place + shift), -2, 2)
        ridge = 0.6 + 0.3 * clouds(azimuth * 40 + shift, 0 * azimuth)
        ridge *= self.skyline * crown * (0.6 + 0.4 * np.sin(np.pi * np.mod(place, 1)))
        ridge += 0.003 * clouds(azimuth * 420, rise * 420)
        tone = 1 + 0.6 * clouds(azimuth * 420, rise * 420 + shift)
        light = self.sky_rgb + 0.35 * self.sun_rgb
        trees = _TREES * np.maximum(tone, 0.15)[:, None] * light
        pale = trees + (0.02 + 0.12 * np.float32(self.haze)) * (_HORIZON - trees)
        return np.where((rise < ridge)[:, None], pale, behind)

    def mirrored(self, directions: Float32, points: Float32) -> Float32:
        """Return (N, 3) what a glossy surface mirrors at some places: sky, a dark street around, road below."""
        if self.level != 1:
            return np.float32(self.level) * self._by_day.mirrored(directions, points)
        far = np.float32(_MIRRORED_AT_M) * directions + points
        x, y = far[:, 0], far[:, 1]
        rise = directions[:, 2]
        tall = self.surround * (1 + 0.7 * clouds(x * 3, y * 3))
        sun = self.sun_rgb * np.float32(self.sun[2])
        lit = np.float32(0.25) + np.float32(0.75) * (clouds(x + 70, y) > -0.3)
        street = (0.10 * (1 + 0.5 * clouds(x * 9, y * 9 + rise * 60)))[:, None] * self._around
        road = np.float32(0.17) * (self.sky_rgb + lit[:, None] * sun)
        below = np.where((rise > -0.04)[:, None], np.maximum(street, 0.01), road)
        return np.where((rise > tall)[:, None], self._clear(directions), below)

    @property
    def _by_day(self) -> "Daylight":
        """The same by day: all light grows with the level."""
        return replace(self, level=1.0)

    @property
    def _around(self) -> Float32:
        """Light on the objects along the street."""
        return self.sky_rgb + np.float32(0.4) * self.sun_rgb


def draw_daylight(
    sun: Float64, is_sunny: bool, rng: np.random.Generator, *, is_night: bool = False
) -> Daylight:
    """Draw the light of one drive for a position of the sun, or of one at night."""
    haze = float(rng.beta(1.2, 1.8))
    daylight = Daylight(
        sun,
        is_sunny,
        cloud_shift=float(rng.uniform(0, 500)),
        strength=float(rng.uniform(0.75, 1.3)),
        haze=haze,
        cover=float(rng.uniform(-1.6, 0.6)),
        skyline=float(rng.uniform(0.01, 0.11)),
        surround=float(rng.uniform(0.15, 0.8)),
    )
    if not is_night:
        return daylight
    low, high = np.log(_NIGHT)
    return replace(daylight, is_sunny=False, level=float(np.exp(rng.uniform(low, high))))
