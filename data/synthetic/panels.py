"""Textures of the painted panels and the panes of cars: creases, strips, handles, gaps, dirt, seats.

Texture coordinates of a body are metres along its sides, or `END_U` plus metres across its ends; and
shares of the way from sill (0) to waist (1), shifted by `SILL_V` and by `VARIANT_V` for each way in which
bodies are finished. Painted things without such coordinates stay as they are.
"""

import numpy as np

from data.synthetic.materials import rgb
from data.synthetic.noise import clouds
from perception.types import Bool, Float32

END_U, SILL_V, VARIANT_V, VARIANTS = 50.0, 2.0, 10.0, 8
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
