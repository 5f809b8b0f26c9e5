"""Patterns on surfaces: what a place on the road or a wall looks like, from its texture coordinates."""

import numpy as np

from data.synthetic.materials import Slot
from data.synthetic.road import RoadShape
from data.synthetic.scene import Hits
from data.synthetic.world import World
from perception.types import Bool, Float32, UInt8


def texture_at(world: World, hits: Hits, rows: np.ndarray) -> Float32:
    """Return (K, 2) texture coordinates of some hits."""
    corners = world.scene.tables.texture_m[hits.row[rows]]
    u, v = hits.u[rows, None], hits.v[rows, None]
    first = corners[:, 0]
    return np.asarray(first + u * (corners[:, 1] - first) + v * (corners[:, 2] - first))


def is_marking(shape: RoadShape, s_m: Float32, l_m: Float32) -> Bool:
    """Tell where the road is painted: a dashed centreline, and lines along the parking lanes."""
    dash = (np.mod(s_m, 9.0) < 3.0) & (np.abs(l_m) < 0.06)
    side = np.abs(l_m)
    edge = np.abs(side - shape.lane_m) < 0.05
    if shape.parking_m < 1.0:
        edge = np.abs(side - shape.half_width_m + 0.25) < 0.05
        return np.asarray(dash | edge)
    bay = (np.mod(s_m, 5.6) < 0.08) & (side > shape.lane_m)
    return np.asarray(dash | (edge & (np.mod(s_m, 2.0) < 1.0)) | bay)


def marking_reflectance(world: World, hits: Hits, slots: UInt8, albedo: Float32) -> Float32:
    """Raise the reflectance of what is painted on the road."""
    road = np.flatnonzero((slots == Slot.ASPHALT) & (hits.row >= 0))
    place = texture_at(world, hits, road)
    painted = is_marking(world.config.road, place[:, 0], place[:, 1])
    raised = albedo.copy()
    raised[road[painted]] = 0.62
    return raised
