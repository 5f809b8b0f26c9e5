"""Daylight: sun, sky, clouds and what glossy surfaces mirror of them."""

from dataclasses import dataclass

import numpy as np

from data.synthetic.materials import rgb
from data.synthetic.textures import clouds
from perception.types import Float32, Float64

_ZENITH = rgb(0.30, 0.55, 1.0)
_HORIZON = rgb(1.05, 1.10, 1.15)
_CLOUD = rgb(1.5, 1.5, 1.5)
_HILLS = rgb(0.10, 0.14, 0.09)
_GREY_SKY = rgb(1.3, 1.33, 1.36)


@dataclass(frozen=True)
class Daylight:
    """The light of one drive.

    Attributes:
        sun: (3,) unit vector towards the sun.
        is_sunny: whether it is out.
        cloud_shift: where the clouds stand, in texture units.
    """

    sun: Float64
    is_sunny: bool
    cloud_shift: float

    @property
    def sun_rgb(self) -> Float32:
        """Light of the sun on a surface that faces it."""
        low = 1 - float(self.sun[2])
        warm = rgb(2.5, 2.36 - 0.3 * low, 2.12 - 0.7 * low)
        return warm if self.is_sunny else np.zeros(3, np.float32)

    @property
    def sky_rgb(self) -> Float32:
        """Light of the whole sky on a surface that faces up."""
        return rgb(0.34, 0.41, 0.54) if self.is_sunny else rgb(1.35, 1.4, 1.46)

    def sky(self, directions: Float32) -> Float32:
        """Return (N, 3) what is seen along directions that meet nothing: sky, clouds, far hills."""
        rise = directions[:, 2]
        height = np.clip(rise, 0.0, 1.0)[:, None]
        share = np.sqrt(height) * 1.1
        clear = _HORIZON + np.minimum(share, 1) * (_ZENITH - _HORIZON)
        span = 1 / np.maximum(rise + 0.12, 0.05)
        x, y = directions[:, 0] * span * 40 + self.cloud_shift, directions[:, 1] * span * 40
        cover = clouds(x, y) + 0.1
        if not self.is_sunny:
            tone = 1 + 0.04 * cover
            clear = _GREY_SKY * tone[:, None] * (0.85 + 0.15 * height)
        else:
            amount = np.clip(cover * 0.6, 0, 0.9)[:, None]
            clear = clear + amount * (_CLOUD - clear)
        azimuth = np.arctan2(directions[:, 1], directions[:, 0])
        ridge = 0.012 + 0.010 * clouds(azimuth * 80, 0 * azimuth)
        hills = _HILLS + 0.55 * (_HORIZON * (1.0 if self.is_sunny else 0.8) - _HILLS)
        return np.where((rise < ridge)[:, None], hills, clear)

    def mirrored(self, directions: Float32) -> Float32:
        """Return (N, 3) what a glossy surface mirrors: sky above, a dark street around, road below."""
        rise = directions[:, 2]
        height = np.clip(rise, 0, 1)[:, None]
        sky = _HORIZON + np.sqrt(height) * (_ZENITH - _HORIZON) if self.is_sunny else _GREY_SKY
        wobble = 0.22 + 0.10 * clouds(np.arctan2(directions[:, 1], directions[:, 0]) * 12, 0 * rise)
        street = np.where((rise > -0.03)[:, None], rgb(0.16, 0.15, 0.14), rgb(0.20, 0.20, 0.20))
        return np.where((rise > wobble)[:, None], sky, street)
