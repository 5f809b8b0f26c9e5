"""Place clutter along a road: bushes and grass, rails, boxes, islands with signals, parking lots.

All of it is drawn from a generator of its own, so that a street without it is the same street.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np

from data.synthetic import vegetation
from data.synthetic.road import Road
from data.synthetic.roadside import Plot, draw_places, islands
from data.synthetic.street import Part
from data.synthetic.town import Clearing, IsFree, is_always_free
from data.synthetic.verge import RAIL_M, Verge


@dataclass(frozen=True)
class ClutterConfig:
    """Amounts of clutter along a road; shares from 0 to 1, numbers per 100 m of each side.

    Attributes:
        bushes: Thickets of one to six bushes on the land.
        grass: Patches of tall grass on the land and along the kerb.
        conifers: Trees with twigs down to the ground.
        rails: Share of the edges with a guard rail, or a barrier of concrete.
        railings: Share of the pavements' edges with a railing or a fence of wire.
        boxes: Cabinets, bins, pillars, boards, benches and bicycle stands.
        shelters: Bus stops.
        poles: Groups of poles, signs and signals on the pavement.
        islands: Traffic islands in the middle of the road, with signs and signals.
        delineators: White posts.
        parking_lots: Parking lots beside the road.
        trimmed: Trimmed bushes, one or a row.
        structures: Kiosks, cabins, containers and skips.
        enclosures: Mesh fences, hedges and rows of trees along the road, up to 35 m from it.
        sites: Building sites along the kerb: cones, beacons, barriers of boards, mesh fences, skips.
        bicycles: Parked bicycles, alone or in rows, at stands or along a wall.
        motorcycles: Parked motorcycles and scooters, one to six together.
        bays: Parking bays with plants, motorcycles or bicycles; beds of plants at the kerb without
            a parking lane.
    """

    bushes: float = 0.0
    grass: float = 0.0
    conifers: float = 0.0
    rails: float = 0.0
    railings: float = 0.0
    boxes: float = 0.0
    shelters: float = 0.0
    poles: float = 0.0
    islands: float = 0.0
    delineators: float = 0.0
    parking_lots: float = 0.0
    trimmed: float = 0.0
    structures: float = 0.0
    enclosures: float = 0.0
    sites: float = 0.0
    bicycles: float = 0.0
    motorcycles: float = 0.0
    bays: float = 0.0
    low_furniture: float = 0.0


def place_clutter(
    road: Road,
    stretch_m: tuple[float, float],
    clutter: ClutterConfig,
    clearings: Sequence[Clearing],
    rng: np.random.Generator,
    is_free: IsFree = is_always_free,
) -> list[Part]:
    """Return the clutter of a stretch of road.

    Args:
        road: Road.
        stretch_m: Start and end of the stretch in metres.
        clutter: Amounts of clutter.
        clearings: Stretches where nothing may be placed.
        rng: Random generator of positions and shapes.
        is_free: Function that tells whether large objects may stand beside the road, by start, length and side.
    """
    if not any(getattr(clutter, amount.name) for amount in fields(clutter)):
        return []
    parts = islands(road, stretch_m, clutter.islands, clearings, rng)
    for verge in _verges(road, rng, is_free).values():
        amounts: list[tuple[float, Callable[[float], list[Part]]]] = [
            (clutter.bushes, verge.thicket),
            (clutter.grass, verge.grass),
            (clutter.conifers, verge.conifer),
            (clutter.boxes, verge.box),
            (clutter.shelters, verge.shelter),
            (clutter.poles, verge.poles),
            (clutter.delineators, verge.delineator),
            (clutter.rails * 100 / RAIL_M, verge.rail),
            (clutter.railings * 100 / RAIL_M, verge.railing),
            (clutter.trimmed, verge.trimmed),
            (clutter.structures, verge.structure),
            (clutter.enclosures, verge.enclosure),
            (clutter.sites, verge.site),
            (clutter.bicycles, verge.bicycles),
            (clutter.motorcycles, verge.motorcycles),
            (clutter.low_furniture, verge.low_furniture),
        ]
        for amount, place in amounts:
            for s_m in draw_places(stretch_m, amount, rng):
                if all(abs(s_m - clearing.s_m) > clearing.half_m for clearing in clearings):
                    parts += place(s_m)
    return parts


def place_bays(road: Road, bays: Sequence[Plot], rng: np.random.Generator) -> list[Part]:
    """Return what stands in parking bays without vehicles: plants, motorcycles or bicycles."""
    if not bays:
        return []
    verges = _verges(road, rng, is_always_free)
    return [part for bay in bays for part in verges[bay.side].bay(bay)]


def _verges(road: Road, rng: np.random.Generator, is_free: IsFree) -> dict[int, Verge]:
    """Return the verges of a road by side, with the plants that grow on both."""
    shrubs = [vegetation.bush(rng) for _ in range(6)]
    grasses = [vegetation.tuft(rng) for _ in range(3)]
    return {side: Verge(road, side, rng, shrubs, grasses, is_free) for side in (-1, 1)}
