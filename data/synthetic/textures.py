"""Texture coordinates of hits, and where a road is marked."""

import numpy as np

from data.synthetic.materials import Slot
from data.synthetic.raycasting import Hits, SurfaceTables
from data.synthetic.road import RoadShape
from data.synthetic.world import World
from perception.types import Bool, Float32, Int, UInt8

_PAINT_REFLECTANCE = 0.62


def texture_at(tables: SurfaceTables, hits: Hits, rows: Int) -> Float32:
    """Return (K, 2) texture coordinates of some hits."""
    corners = np.take(tables.texture_m, hits.row[rows], axis=0)
    u, v = hits.u[rows, None], hits.v[rows, None]
    first = corners[:, 0]
    return np.asarray(first + u * (corners[:, 1] - first) + v * (corners[:, 2] - first))


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
