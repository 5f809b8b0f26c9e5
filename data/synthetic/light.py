"""Daylight: sun, sky, clouds and what glossy surfaces mirror of them."""

from dataclasses import dataclass

import numpy as np

from data.synthetic.textures import smooth_noise
from perception.types import Float32, Float64

_ZENITH = np.float32([0.20, 0.36, 0.72])
_HORIZON = np.float32([0.70, 0.78, 0.88])
_CLOUD = np.float32([0.95, 0.96, 0.98])
_HILLS = np.float32([0.10, 0.14, 0.09])
_GREY_SKY = np.float32([0.78, 0.80, 0.83])


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
        warm = np.float32([2.1, 1.98 - 0.25 * low, 1.78 - 0.6 * low])
        return warm if self.is_sunny else np.zeros(3, np.float32)

    @property
    def sky_rgb(self) -> Float32:
        """Light of the whole sky on a surface that faces up."""
        return np.float32([0.55, 0.64, 0.80]) if self.is_sunny else np.float32([1.35, 1.4, 1.46])

    def sky(self, directions: Float32) -> Float32:
        """Return (N, 3) what is seen along directions that meet nothing: sky, clouds, far hills."""
        rise = directions[:, 2]
        height = np.clip(rise, 0.0, 1.0)[:, None]
        share = np.sqrt(height) * 1.1
        clear = _HORIZON + np.minimum(share, 1) * (_ZENITH - _HORIZON)
        span = 1 / np.maximum(rise + 0.12, 0.05)
        x, y = directions[:, 0] * span * 40 + self.cloud_shift, directions[:, 1] * span * 40
        cover = smooth_noise(x, y) + 0.3
        if not self.is_sunny:
            tone = 1 + 0.04 * cover
            clear = _GREY_SKY * tone[:, None] * (0.85 + 0.15 * height)
        else:
            amount = np.clip(cover * 0.6, 0, 0.9)[:, None]
            clear = clear + amount * (_CLOUD - clear)
        azimuth = np.arctan2(directions[:, 1], directions[:, 0])
        ridge = 0.012 + 0.010 * smooth_noise(azimuth * 80, 0 * azimuth)
        hills = _HILLS + 0.55 * (_HORIZON * (1.0 if self.is_sunny else 0.8) - _HILLS)
        return np.where((rise < ridge)[:, None], hills, clear)

    def mirrored(self, directions: Float32) -> Float32:
        """Return (N, 3) what a glossy surface mirrors: sky above, a dark street around, road below."""
        rise = directions[:, 2]
        height = np.clip(rise, 0, 1)[:, None]
        sky = _HORIZON + np.sqrt(height) * (_ZENITH - _HORIZON) if self.is_sunny else _GREY_SKY
        wobble = 0.22 + 0.10 * smooth_noise(np.arctan2(directions[:, 1], directions[:, 0]) * 40, 0 * rise)
        street = np.where((rise > -0.03)[:, None], np.float32([0.16, 0.15, 0.14]), np.float32([0.20, 0.20, 0.20]))
        return np.where((rise > wobble)[:, None], sky, street)
