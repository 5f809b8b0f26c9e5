"""From light to an image: metering, lens, colours, noise, tones and a Bayer mosaic."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from data.synthetic.materials import rgb
from perception.kernels.rendering import develop_pixels
from perception.types import Float32, Float64, UInt8

_LUMINANCE = rgb(0.30, 0.59, 0.11)
_KEY = 0.19  # light that metering makes the middle of an image
_METERING_STEP_PX = 8
# Share of the mirrored noise that each colour has beside the common noise.
_NOISE_TINT = rgb(0.5, -0.2, 0.6)
_NIGHT_NOISE = 4.0  # noise at night, relative to that of the day
_FULL = 4095  # last entry of the table of tones


@dataclass(frozen=True)
class Exposure:
    """Properties of the camera.

    Attributes:
        gain: Gain of the light.
        noise: Standard deviation of the sensor's noise at mid grey, in grey levels of 255.
        blur_px: Blur of the lens in pixels, standard deviation.
        metering: Weight of automatic exposure, from 0 for a fixed gain to 1 for an image of middle brightness.
        contrast: Steepness of the tone curve in its middle; 1 for the display's gamma alone.
        saturation: Saturation of colours relative to the light.
        white: (3,) gains of red, green and blue.
        vignette: Share of the light that is lost in the corners.
        has_mosaic: Whether each pixel senses one colour, the others being interpolated.
    """

    gain: float = 1.0
    noise: float = 1.6
    blur_px: float = 0.55
    metering: float = 0.0
    contrast: float = 1.35
    saturation: float = 1.0
    white: tuple[float, float, float] = (1.0, 1.0, 1.0)
    vignette: float = 0.10
    has_mosaic: bool = False


def draw_exposure(rng: np.random.Generator, *, is_night: bool = False) -> Exposure:
    """Draw how the camera of one drive is made and set; at night its gain is high, and with it its noise."""
    warmth, tint = rng.normal(0, [0.07, 0.02])
    exposure = Exposure(
        gain=float(np.exp(rng.normal(0.0, 0.22))),
        noise=float(rng.uniform(0.3, 1.8)),
        blur_px=float(rng.uniform(0.5, 0.72)),
        metering=float(rng.uniform(0.6, 0.95)),
        contrast=float(rng.uniform(1.25, 1.9)),
        saturation=float(rng.uniform(0.75, 1.35)),
        white=(float(1 + warmth), float(1 + tint), float(1 - warmth)),
        vignette=float(rng.uniform(0.0, 0.22)),
        has_mosaic=bool(rng.random() < 0.75),
    )
    return replace(exposure, noise=_NIGHT_NOISE * exposure.noise) if is_night else exposure


def develop(light: Float32, exposure: Exposure, rng: np.random.Generator) -> UInt8:
    """Turn (H, W, 3) light into an image."""
    height, width = light.shape[:2]
    exposed = np.asarray(
        cv2.transform(light, _colours(exposure) * _gain(light, exposure)), np.float32
    )
    if exposure.blur_px > 0:
        exposed = np.asarray(cv2.GaussianBlur(exposed, (0, 0), exposure.blur_px), np.float32)
    y, x = np.ogrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    fall = (1 - exposure.vignette * (x * x + 0.4 * y * y)).astype(np.float32)
    noise = rng.standard_normal((height, width), np.float32) * np.float32(exposure.noise)
    image = np.empty((height, width, 3), np.uint8)
    develop_pixels(image, exposed, fall, noise, _NOISE_TINT, _tones(exposure.contrast))
    return _through_mosaic(image) if exposure.has_mosaic else image


def _gain(light: Float32, exposure: Exposure) -> float:
    """Return the gain by metering a sparse grid of pixels below the sky, which may clip."""
    if exposure.metering == 0:
        return exposure.gain
    street = light[light.shape[0] // 3 :]
    sparse = street[::_METERING_STEP_PX, ::_METERING_STEP_PX] @ _LUMINANCE
    middle = float(np.sqrt(np.clip(sparse, 0, 2)).mean()) ** 2
    return float(exposure.gain * (_KEY / max(middle, 1e-4)) ** exposure.metering)


def _colours(exposure: Exposure) -> Float64:
    """Return the (3, 3) matrix that balances white and saturates colours."""
    grey = np.broadcast_to((1 - exposure.saturation) * _LUMINANCE, (3, 3))
    return np.asarray((grey + exposure.saturation * np.eye(3)) * np.array(exposure.white))


def _tones(contrast: float) -> Float32:
    """Return the grey levels of light from 0 to 1: the display's gamma, then a curve about its middle."""
    tone = np.linspace(0, 1, _FULL + 1) ** (1 / 2.2)
    rising = tone**contrast
    return (255 * rising / (rising + (1 - tone) ** contrast)).astype(np.float32)


def _through_mosaic(image: UInt8) -> UInt8:
    """Keep one colour a pixel, in squares of red, green, green and blue; interpolate the others."""
    mosaic = image[..., 1].copy()
    mosaic[::2, ::2] = image[::2, ::2, 0]
    mosaic[1::2, 1::2] = image[1::2, 1::2, 2]
    return np.asarray(cv2.cvtColor(mosaic, cv2.COLOR_BayerBG2RGB_EA), np.uint8)
