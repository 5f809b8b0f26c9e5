"""Lay out a street: plots of houses and gardens, furniture along the kerb, parked vehicles."""

from dataclasses import dataclass

import numpy as np

from data.synthetic import meshes, street
from data.synthetic.materials import SemanticClass, palette
from data.synthetic.road import Road
from data.synthetic.street import Part
from perception.types import Float64


@dataclass(frozen=True)
class TownStyle:
    """How a street is built up; shares from 0 to 1.

    Attributes:
        houses: share of plots with a house at the pavement's edge.
        greenery: share of kerbside places with a tree, and of gardens with a hedge.
        furniture: share of kerbside places with a lamp, sign or bollard.
        parking: share of parking places taken, where there is a parking lane.
    """

    houses: float = 0.65
    greenery: float = 0.4
    furniture: float = 0.75
    parking: float = 0.55


@dataclass(frozen=True)
class Clearing:
    """A stretch of road where nothing may stand, as where people cross.

    Attributes:
        s_m: its middle.
        half_m: half its length.
    """

    s_m: float
    half_m: float


def furnish(
    road: Road,
    stretch_m: tuple[float, float],
    style: TownStyle,
    clearings: list[Clearing],
    rng: np.random.Generator,
) -> list[Part]:
    """Return the ground of a stretch and all that stands on it."""
    parts = [street.ground(road, *stretch_m)]
    for side in (-1, 1):
        parts += _plots(road, stretch_m, side, style, rng)
        parts += _kerbside(road, stretch_m, side, style, clearings, rng)
        parts += _backdrop(road, stretch_m, side, rng)
    return parts


def _plots(
    road: Road,
    stretch_m: tuple[float, float],
    side: int,
    style: TownStyle,
    rng: np.random.Generator,
) -> list[Part]:
    """Fill one side behind the pavement with houses and gardens, plot after plot."""
    edge = road.shape.half_width_m + road.shape.pavement_m
    parts: list[Part] = []
    s = stretch_m[0]
    while s < stretch_m[1] - 8:
        length = float(rng.uniform(9, 17))
        if rng.random() < style.houses:
            setback = 0.3 + float(rng.choice([0.0, 0.0, 3.0]))
            parts.append(_house(road, s, side, edge + setback, length, rng))
            if setback > 1:
                parts += _border(road, s, side, edge + 0.3, length, style, rng)
        else:
            parts += _border(road, s, side, edge + 0.3, length, style, rng)
            parts += _garden(road, s, side, edge, length, style, rng)
        s += length + float(rng.choice([0.3, 0.3, 3.5]))
    return parts


def _along(road: Road, s_m: float, side: int, edge_m: float, length_m: float) -> Float64:
    """Return the pose of a straight thing of some length along the road, its outside turned to it."""
    ends = road.place(np.array([s_m, s_m + length_m]), np.full(2, side * edge_m))
    if side > 0:
        start, turn = ends[0], 0.0
    else:
        start, turn = ends[1], np.pi
    way = ends[1] - ends[0]
    heading = float(np.arctan2(way[1], way[0])) + turn
    from perception.geometry import se3

    low = np.array([start[0], start[1], ends[:, 2].min()])
    return se3.from_euler(0.0, 0.0, heading, low)


def _house(
    road: Road, s_m: float, side: int, edge_m: float, length_m: float, rng: np.random.Generator
) -> Part:
    floors = int(rng.choice([2, 2, 3, 3, 4]))
    # Straight houses stand clear of the pavement where the road curves.
    sagitta = road.shape.curvature_1_m * length_m**2 / 8
    pose = _along(road, s_m, side, edge_m + sagitta, length_m)
    return Part(meshes.moved(street.house(length_m, floors, rng), pose), street.house_palette(rng))


def _border(
    road: Road,
    s_m: float,
    side: int,
    edge_m: float,
    length_m: float,
    style: TownStyle,
    rng: np.random.Generator,
) -> list[Part]:
    """Close a plot off towards the pavement by a hedge, a fence or a low wall."""
    sagitta = road.shape.curvature_1_m * length_m**2 / 8
    pose = _along(road, s_m, side, edge_m + sagitta + 0.4, length_m)
    height, kind = float(rng.uniform(0.8, 1.7)), rng.random()
    if kind < style.greenery:
        hedge = street.hedge(length_m, height, rng)
        return [Part(meshes.moved(hedge, pose), street.foliage_palette(rng))]
    if kind < 0.85:
        return [Part(meshes.moved(street.fence(length_m, min(height, 1.3)), pose), palette())]
    wall = meshes.moved(street.garden_wall(length_m, min(height, 1.1)), pose)
    return [Part(wall, street.house_palette(rng), SemanticClass.FENCE)]


def _garden(
    road: Road,
    s_m: float,
    side: int,
    edge_m: float,
    length_m: float,
    style: TownStyle,
    rng: np.random.Generator,
) -> list[Part]:
    count = 1 + int(rng.random() < style.greenery)
    parts = []
    for _ in range(count):
        s, l = s_m + rng.uniform(1, length_m - 1), side * (edge_m + rng.uniform(3, 9))  # noqa: E741
        parts.append(_tree(road, s, l, rng))
    return parts


def _tree(road: Road, s_m: float, l_m: float, rng: np.random.Generator) -> Part:
    mesh = street.tree(float(rng.uniform(5, 10)), rng)
    pose = street.standing(road, s_m, l_m, float(rng.uniform(0, 6.28)))
    return Part(meshes.moved(mesh, pose), street.foliage_palette(rng))


def _kerbside(
    road: Road,
    stretch_m: tuple[float, float],
    side: int,
    style: TownStyle,
    clearings: list[Clearing],
    rng: np.random.Generator,
) -> list[Part]:
    """Stand lamps, signs, bollards and trees in a row behind the kerb."""
    parts: list[Part] = []
    places = np.arange(stretch_m[0] + 3, stretch_m[1] - 3, 6.5) + rng.uniform(0, 3)
    for number, s in enumerate(places):
        row = side * (road.shape.half_width_m + 0.5)
        s_m = float(s + rng.uniform(-1.5, 1.5))
        if any(abs(s_m - c.s_m) < c.half_m for c in clearings):
            continue
        if number % 4 == 0:
            parts.append(_lamp(road, s_m, row, side, rng))
        elif rng.random() < style.furniture * 0.6:
            parts.append(_post(road, s_m, row, side, rng))
        elif rng.random() < style.greenery:
            parts.append(_tree(road, s_m, row, rng))
    return parts


def _lamp(road: Road, s_m: float, l_m: float, side: int, rng: np.random.Generator) -> Part:
    mesh = street.lamp(float(rng.uniform(5, 8)), float(rng.uniform(0.04, 0.05)), 1.2)
    turn = np.pi if side > 0 else 0.0  # the arm, along y, reaches over the road
    return Part(meshes.moved(mesh, street.standing(road, s_m, l_m, turn)), palette())


def _post(road: Road, s_m: float, l_m: float, side: int, rng: np.random.Generator) -> Part:
    """Stand a sign that faces the traffic of its side, or a bollard."""
    if rng.random() < 0.6:
        kind = int(rng.choice([0, 0, 1, 2, 2, 3]))
        mesh, colours = street.sign(kind, 0.03), street.sign_palette(kind, rng)
    else:
        mesh, colours = (
            street.bollard(float(rng.uniform(0.9, 1.1)), float(rng.uniform(0.025, 0.05))),
            palette(),
        )
    turn = np.pi if side > 0 else 0.0
    return Part(meshes.moved(mesh, street.standing(road, s_m, l_m, turn)), colours)


def _backdrop(
    road: Road, stretch_m: tuple[float, float], side: int, rng: np.random.Generator
) -> list[Part]:
    """Stand loose rows of tall trees behind the houses."""
    outer = road.shape.half_width_m + road.shape.pavement_m
    parts = []
    for s in np.arange(stretch_m[0], stretch_m[1], 14.0):
        l_m = side * (outer + float(rng.uniform(17, 30)))
        mesh = street.tree(float(rng.uniform(9, 15)), rng, leaves=700)
        pose = street.standing(road, float(s + rng.uniform(-5, 5)), l_m)
        parts.append(Part(meshes.moved(mesh, pose), street.foliage_palette(rng)))
    return parts
