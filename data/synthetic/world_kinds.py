"""Kinds of worlds: town, housing, cycling and shopping streets, main roads, junctions, industry, parks, country, jams.

Each is drawn with its own amounts of everything, so that no two worlds look alike.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from data.synthetic.clutter import ClutterConfig
from data.synthetic.road import RoadShape
from data.synthetic.town import TownConfig
from data.synthetic.words import StreetKind
from data.synthetic.world_config import WorldConfig

# What draws of a street begin with: trees of fewer leaves, as there are many of them.
_TOWN = TownConfig(houses=0.0, leaves=1000)
_BARE = TownConfig(
    houses=0.0, greenery=0.0, furniture=0.0, parking=0.0, borders=0.0, lamps=0.0, backdrop=0.0,
    gardens=0.0,
)  # fmt: skip
_ANGLE_PARKED = 0.35  # share of streets with parking lanes where vehicles stand at an angle
Amounts = TypeVar("Amounts", TownConfig, ClutterConfig)


def draw_config(rng: np.random.Generator) -> WorldConfig:
    """Draw a world of one of the kinds."""
    kinds = list(_SHARES)
    return STREETS[kinds[int(rng.choice(len(kinds), p=list(_SHARES.values())))]](rng)


def furnished_street(rng: np.random.Generator) -> WorldConfig:
    """Draw a world of one of the kinds, with low signs, bollards, pillars and narrow plants beside people, and light trucks."""
    config = draw_config(rng)
    config = replace(
        config,
        waiting=_between(rng, 1, 6),
        groups=_between(rng, 0, 0.5),
        sheltered=_between(rng, 0, 0.6),
        light_trucks=_between(rng, 0, 0.3),
    )
    return replace(config, clutter=_drawn(rng, config.clutter, low_furniture=(4, 40)))


def town_street(rng: np.random.Generator) -> WorldConfig:
    """Draw a street of houses and gardens: narrower, greener, busier, steeper."""
    road = _curved(rng, min_radius_m=110, slope=0.05)
    road = replace(
        road,
        lane_m=_between(rng, 3.3, 4.0),
        parking_m=float(rng.choice([0.0, 2.1, 2.1, 2.3])),
        pavement_m=_between(rng, 2.2, 4.0),
    )
    road, angle_rad = _angle_parked(rng, road)
    town = _drawn(
        rng, _TOWN, houses=(0.1, 0.95), greenery=(0.05, 0.55), furniture=(0.05, 0.6),
        parking=(0.2, 0.9), borders=(0.3, 1.0), lamps=(0.1, 0.8), backdrop=(0.1, 0.8),
        low_crowns=(0.1, 0.8), ground_reflectance=(0.75, 1.25),
    )  # fmt: skip
    town = replace(town, parking_rad=angle_rad)
    clutter = _drawn(
        rng, ClutterConfig(), bushes=(0, 7), grass=(0, 20), conifers=(0, 2), railings=(0, 0.2),
        boxes=(1, 6), shelters=(0, 0.6), poles=(0, 1.2), parking_lots=(0, 1.5), trimmed=(0, 3),
        structures=(0, 0.4), bicycles=(0, 2), motorcycles=(0, 0.8), bays=(0, 2), islands=(0, 0.4),
        sites=(0, 0.8),
    )  # fmt: skip
    config = _peopled(rng, WorldConfig(road=road, town=town, clutter=clutter), heavy=0.12)
    return replace(config, trams=float(rng.choice([0.0, 0.0, 0.1])))


def housing_street(rng: np.random.Generator) -> WorldConfig:
    """Draw a narrow street with vehicles parked along both sides, hedges and dustbins."""
    config = town_street(rng)
    road = replace(config.road, parking_m=_between(rng, 2.0, 2.3), lane_m=_between(rng, 3.2, 3.6))
    road, angle_rad = _angle_parked(rng, road)
    town = replace(config.town, parking_rad=angle_rad)
    town = _drawn(rng, town, houses=(0.6, 0.95), parking=(0.6, 1.0), greenery=(0.3, 0.9))
    clutter = _drawn(rng, replace(config.clutter, parking_lots=0.0), boxes=(4, 10), bushes=(3, 10))
    clutter = _drawn(rng, clutter, trimmed=(1, 8), bicycles=(0, 3), bays=(0, 3))
    return replace(
        config,
        road=road,
        town=town,
        clutter=clutter,
        ego_m_s=_between(rng, 5, 9),
        heavy=0.03,
        trams=0.0,
    )


def main_road(rng: np.random.Generator) -> WorldConfig:
    """Draw a wide road of several lanes with guard rails, heavy traffic, and green beside it."""
    lanes = int(rng.choice([1, 2, 2]))
    road = replace(
        _on_uneven_land(rng, _curved(rng, min_radius_m=250, slope=0.03), height_m=2.5),
        lane_m=_between(rng, 3.5, 4.2),
        lanes=lanes,
        parking_m=0.0,
        pavement_m=_between(rng, 0.8, 3.0),
    )
    town = _drawn(
        rng, _TOWN, greenery=(0.05, 0.5), furniture=(0.05, 0.4), borders=(0.0, 0.4),
        lamps=(0.0, 1.0), backdrop=(0.1, 0.8), low_crowns=(0.1, 0.8),
        ground_reflectance=(0.7, 1.25),
    )  # fmt: skip
    clutter = _drawn(
        rng, ClutterConfig(), bushes=(3, 14), grass=(10, 40), conifers=(0, 4), rails=(0.04, 0.32),
        railings=(0, 0.25), boxes=(0, 2), poles=(0, 0.8), delineators=(0, 3), trimmed=(0, 2),
        structures=(0, 0.3), enclosures=(0, 0.6), islands=(0, 0.6), bays=(0, 0.8), sites=(0, 0.8),
    )  # fmt: skip
    config = WorldConfig(road=road, town=town, clutter=clutter)
    return replace(
        _peopled(rng, config, heavy=0.25),
        ego_m_s=_between(rng, 11, 19),
        ego_lane=int(rng.integers(lanes)),
        cyclists=_between(rng, 0, 1),
        pedestrians=_between(rng, 0, 2),
        crossing_every_s=0.0,
    )


def open_junction(rng: np.random.Generator) -> WorldConfig:
    """Draw an open place: islands with signals and signs, groups of poles, bus stops, yards of vehicles."""
    lanes = int(rng.choice([1, 2]))
    road = replace(
        _curved(rng, min_radius_m=150, slope=0.02),
        lane_m=_between(rng, 4.2, 4.9) if lanes == 1 else _between(rng, 3.9, 4.3),
        lanes=lanes,
        parking_m=0.0,
        kerb_m=_between(rng, 0.05, 0.3),
        pavement_m=_between(rng, 2.5, 6.0),
    )
    town = _drawn(
        rng, _TOWN, houses=(0.0, 0.35), greenery=(0.05, 0.5), furniture=(0.1, 0.7),
        parking=(0.3, 0.95), borders=(0.0, 0.5), lamps=(0.1, 0.8), backdrop=(0.1, 0.8),
        low_crowns=(0.1, 0.8), ground_reflectance=(0.7, 1.25),
    )  # fmt: skip
    clutter = _drawn(
        rng, ClutterConfig(), bushes=(2, 12), grass=(0, 25), conifers=(0, 2), rails=(0, 0.05),
        railings=(0, 0.3), boxes=(1, 5), shelters=(0.2, 1.2), poles=(1.5, 5), islands=(1, 5),
        parking_lots=(0.5, 4), trimmed=(0, 4), structures=(0, 1), enclosures=(0, 0.4),
        bicycles=(0, 1.5), motorcycles=(0, 0.5), bays=(0, 2), sites=(0, 0.8),
    )  # fmt: skip
    config = WorldConfig(road=road, town=town, clutter=clutter)
    return replace(
        _peopled(rng, config, heavy=0.15),
        trams=float(rng.choice([0.0, 0.0, 0.15])),
        ego_lane=int(rng.integers(lanes)),
        crossing_every_s=0.0 if lanes > 1 else 11.0,
    )


def country_road(rng: np.random.Generator) -> WorldConfig:
    """Draw a road without kerbs between slopes and ditches, grass, bushes and woods."""
    road = replace(
        _on_uneven_land(rng, _curved(rng, min_radius_m=120, slope=0.06), height_m=4.0),
        lane_m=_between(rng, 3.1, 3.7),
        parking_m=0.0,
        kerb_m=0.0,
        pavement_m=_between(rng, 0.6, 1.6),
    )
    town = _drawn(
        rng, replace(_TOWN, lamps=0.0), greenery=(0.0, 0.5), furniture=(0.0, 0.2),
        borders=(0.0, 0.3), backdrop=(0.0, 0.8), low_crowns=(0.1, 0.8),
        ground_reflectance=(0.75, 1.25),
    )  # fmt: skip
    clutter = _drawn(rng, ClutterConfig(), bushes=(3, 15), grass=(10, 50), conifers=(0, 6))
    clutter = replace(clutter, rails=float(rng.choice([0.0, 0.1, 0.25])))
    clutter = _drawn(rng, clutter, boxes=(0, 0.5), delineators=(0, 4), trimmed=(0, 1.5))
    clutter = _drawn(rng, clutter, structures=(0, 0.3), enclosures=(0, 0.8))
    config = WorldConfig(road=road, town=town, clutter=clutter)
    return replace(
        _peopled(rng, config, heavy=0.12),
        ego_m_s=_between(rng, 9, 18),
        cyclists=_between(rng, 0, 3),
        pedestrians=0.0,
        waiting=0.0,
        crossing_every_s=0.0,
    )


def industrial_street(rng: np.random.Generator) -> WorldConfig:
    """Draw a street of yards behind mesh fences: lorries, trailers, vans, containers, cabins."""
    config = open_junction(rng)
    road = replace(config.road, parking_m=float(rng.choice([0.0, 2.3])), pavement_m=2.0)
    town = _drawn(rng, config.town, houses=(0.0, 0.3), greenery=(0.0, 0.3), parking=(0.5, 1.0))
    clutter = _drawn(
        rng, replace(config.clutter, islands=0.0, shelters=0.0), structures=(0.8, 3),
        enclosures=(0.5, 2), parking_lots=(2, 5), poles=(0, 1),
    )  # fmt: skip
    return replace(
        config, road=road, town=town, clutter=clutter, trams=0.0, heavy=_between(rng, 0.2, 0.5),
        vans=_between(rng, 0.2, 0.5),
    )  # fmt: skip


def cycling_street(rng: np.random.Generator) -> WorldConfig:
    """Draw a street with cycle paths, many cyclists and parked bicycles, between trimmed gardens."""
    config = housing_street(rng) if rng.random() < 0.5 else town_street(rng)
    road = replace(config.road, pavement_m=_between(rng, 3.0, 5.0))
    clutter = _drawn(rng, config.clutter, trimmed=(2, 8), bicycles=(1, 6), bushes=(0, 3))
    return replace(
        config,
        road=road,
        clutter=clutter,
        cyclists=_between(rng, 10, 30),
        cycle_paths=_between(rng, 0.4, 1.0),
    )


def shopping_street(rng: np.random.Generator) -> WorldConfig:
    """Draw a street of tall houses and wide pavements: groups of people, kiosks, bicycles, trams."""
    config = town_street(rng)
    road = replace(config.road, pavement_m=_between(rng, 4.0, 7.0), lane_m=_between(rng, 3.5, 4.2))
    town = _drawn(rng, config.town, houses=(0.75, 1.0), greenery=(0.05, 0.3))
    clutter = _drawn(
        rng, config.clutter, boxes=(3, 10), shelters=(0.3, 1.2), bicycles=(1, 6), poles=(0.5, 3)
    )
    return replace(
        config,
        road=road,
        town=town,
        clutter=_drawn(rng, clutter, structures=(0.3, 1.5), motorcycles=(0.3, 2.5), bays=(0, 3)),
        trams=float(rng.choice([0.0, 0.15, 0.3])),
        pedestrians=_between(rng, 15, 35),
        groups=_between(rng, 0.3, 0.8),
        cyclists=_between(rng, 4, 16),
        cycle_paths=_between(rng, 0.0, 0.8),
    )


def park_road(rng: np.random.Generator) -> WorldConfig:
    """Draw a road along parks: mesh fences, hedges and rows of trees, people before and behind them."""
    config = country_road(rng)
    road = replace(config.road, land_m=(0.0, 0.0), roughness_m=0.03, pavement_m=_between(rng, 1, 3))
    clutter = _drawn(
        rng, config.clutter, enclosures=(2, 6), trimmed=(0, 4), bushes=(0, 4), conifers=(0, 1)
    )
    return replace(
        config,
        road=road,
        clutter=clutter,
        ego_m_s=_between(rng, 5, 20),
        cyclists=_between(rng, 2, 10),
        pedestrians=_between(rng, 2, 10),
        groups=_between(rng, 0.0, 0.5),
        footpath_m=_between(rng, 2, 20),
    )


def traffic_jam(rng: np.random.Generator) -> WorldConfig:
    """Draw a road of several lanes full of lorries, buses and cars that creep, stop and go on."""
    config = main_road(rng)
    lanes = int(rng.integers(2, 4))
    return replace(
        config,
        road=replace(config.road, lanes=lanes, curvature_1_m=config.road.curvature_1_m / 2),
        clutter=replace(config.clutter, parking_lots=_between(rng, 0, 2)),
        ego_m_s=_between(rng, 1.0, 3.5),
        ego_lane=int(rng.integers(lanes)),
        leader_gap_m=_between(rng, 9, 16),
        vehicle_gap_m=_between(rng, 12, 16),
        heavy=_between(rng, 0.4, 0.8),
        trams=float(rng.choice([0.0, 0.0, 0.2])),
        slowdown_every_s=0.0,
        stop_every_s=_between(rng, 30, 120),
    )


def open_field(rng: np.random.Generator) -> WorldConfig:
    """Draw a road through bare fields: nothing above ground beside it, and little traffic."""
    config = country_road(rng)
    road = replace(config.road, land_m=(0.0, 0.0), roughness_m=_between(rng, 0.0, 0.08))
    return replace(
        config,
        road=replace(road, curvature_1_m=road.curvature_1_m / 4),
        town=replace(_BARE, ground_reflectance=config.town.ground_reflectance),
        clutter=_drawn(rng, ClutterConfig(), grass=(0, 10)),
        leader_gap_m=_between(rng, 30, 120),
        vehicle_gap_m=_between(rng, 80, 250),
        cyclists=0.0,
        stop_every_s=0.0,
    )


def road_tunnel(rng: np.random.Generator) -> WorldConfig:
    """Draw a road that enters a tunnel, with bare slopes before and behind it."""
    config = country_road(rng)
    start_m = _between(rng, 20, 60)
    return replace(
        config,
        road=replace(config.road, curvature_1_m=config.road.curvature_1_m / 2),
        town=_BARE,
        clutter=ClutterConfig(),
        tunnel_m=(start_m, start_m + _between(rng, 60, 300)),
        vehicle_gap_m=_between(rng, 25, 80),
        cyclists=0.0,
        stop_every_s=0.0,
    )


STREETS: dict[StreetKind, Callable[[np.random.Generator], WorldConfig]] = {
    "town": town_street,
    "housing": housing_street,
    "main-road": main_road,
    "junction": open_junction,
    "country": country_road,
    "industrial": industrial_street,
    "cycling": cycling_street,
    "shopping": shopping_street,
    "park": park_road,
    "jam": traffic_jam,
    "field": open_field,
    "tunnel": road_tunnel,
    "furnished": furnished_street,
}
# How often each kind is drawn.
_SHARES: dict[StreetKind, float] = {
    "town": 0.17,
    "housing": 0.12,
    "main-road": 0.13,
    "junction": 0.14,
    "country": 0.09,
    "industrial": 0.11,
    "cycling": 0.11,
    "shopping": 0.08,
    "park": 0.05,
}


def _drawn(rng: np.random.Generator, base: Amounts, **limits: tuple[float, float]) -> Amounts:
    """Draw amounts one after the other, each between its limits."""
    amounts: dict[str, Any] = {name: _between(rng, *of_one) for name, of_one in limits.items()}
    return replace(base, **amounts)


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high))


def _curved(rng: np.random.Generator, min_radius_m: float, slope: float) -> RoadShape:
    return RoadShape(
        curvature_1_m=_between(rng, 0, 1 / min_radius_m),
        curve_length_m=_between(rng, 150, 260),
        slope=_between(rng, 0, slope),
        bank=_between(rng, 0, 0.025),
        kerb_m=_between(rng, 0.05, 0.3),
    )


def _angle_parked(rng: np.random.Generator, road: RoadShape) -> tuple[RoadShape, float]:
    """Draw the angle of parked vehicles to the road; a parking lane is as wide as they need."""
    angle_rad = float(rng.choice([0.25, 0.33, 0.5])) * np.pi
    if road.parking_m == 0 or rng.random() >= _ANGLE_PARKED:
        return road, 0.0
    return replace(road, parking_m=_between(rng, 4.9, 5.4)), angle_rad


def _on_uneven_land(rng: np.random.Generator, road: RoadShape, height_m: float) -> RoadShape:
    """Draw slopes up and down beside a road, and how uneven they are."""
    right, left = rng.uniform(-0.4 * height_m, height_m, 2) * (rng.random(2) < 0.7)
    return replace(
        road,
        land_m=(float(right), float(left)),
        land_reach_m=_between(rng, 3, 10),
        roughness_m=_between(rng, 0.03, 0.22),
    )


def _peopled(rng: np.random.Generator, config: WorldConfig, heavy: float) -> WorldConfig:
    """Draw how much traffic there is."""
    return replace(
        config,
        ego_m_s=_between(rng, 6, 12),
        leader_gap_m=_between(rng, 11, 45),
        vehicle_gap_m=_between(rng, 18, 45),
        is_mixed_fleet=True,
        heavy=_between(rng, 0, 2 * heavy),
        vans=_between(rng, 0, 0.3),
        cyclists=_between(rng, 2, 12),
        cycle_paths=_between(rng, 0, 0.8),
        pedestrians=_between(rng, 3, 18),
        groups=_between(rng, 0, 0.5),
        is_sunny=bool(rng.random() < 0.75),
        motorcyclists=_between(rng, 0, 0.12),
        trailers=_between(rng, 0, 0.1),
        is_mixed_crowd=True,
        waiting=_between(rng, 0, 4),
        at_vehicles=_between(rng, 0, 0.15),
        absorption=_between(rng, 0, 0.9),
    )
