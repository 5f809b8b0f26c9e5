"""Light of lamps at night: the ego vehicle's headlights, and the lamps of the other vehicles."""

import numpy as np

from data.synthetic.materials import Slot, rgb
from perception.types import Float32, Float64, UInt8

# Two low beams: places in the LiDAR frame, light at 1 m, and the slopes of the beams' upper edge and of their fall below it.
_LAMPS_VELO_M = np.array([[1.6, 0.65, -1.05], [1.6, -0.65, -1.05]])
_BEAM = 90.0 * rgb(1.0, 0.95, 0.86)
_CUTOFF, _FALL = -0.008, 0.10
_SPREAD = 0.45  # sine of the angle to the side at which a third of the light is left
_ABOVE = 0.012  # share of the light that goes above the edge
_GLOW = {Slot.HEADLIGHT: rgb(4.0, 3.8, 3.4), Slot.TAILLIGHT: rgb(0.5, 0.02, 0.015)}


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
