"""Poles of all sorts, and islands in the middle of the road that carry them."""

from collections.abc import Sequence

import numpy as np

from data.synthetic import furniture, meshes, street
from data.synthetic.materials import palette
from data.synthetic.parking_lots import draw_places
from data.synthetic.road import Road
from data.synthetic.street import Part
from data.synthetic.town import Clearing


def draw_pole(road: Road, rng: np.random.Generator, s_m: float, l_m: float) -> Part:
    """Stand a signal, a sign, a lamp or a bare post, facing either way."""
    draw, reach_m = rng.random(), 0.0
    if draw < 0.45:
        if abs(l_m) > 1 and rng.random() < 0.3:
            reach_m = float(rng.uniform(2, 4.5))
        mesh = furniture.signal(float(rng.uniform(3.0, 5.5)), reach_m, rng)
        appearance = furniture.panel_palette(rng)
    elif draw < 0.8:
        kind = int(rng.choice([0, 0, 1, 2, 3]))
        mesh, appearance = (
            furniture.sign(kind, float(rng.uniform(0.03, 0.05))),
            furniture.sign_palette(kind, rng),
        )
    else:
        radius_m = float(rng.uniform(0.04, 0.14))
        mesh, appearance = (
            furniture.bollard(float(rng.uniform(0.9, 7)), radius_m),
            furniture.panel_palette(rng),
        )
    # An arm reaches along y, over the road.
    is_left = l_m > 0
    if reach_m == 0 and rng.random() < 0.4:
        is_left = not is_left
    pose = street.upright_pose(
        road, s_m, l_m, (np.pi if is_left else 0.0) + float(rng.normal(0, 0.15))
    )
    return Part(meshes.moved(mesh, pose), appearance)


def islands(
    road: Road,
    stretch_m: tuple[float, float],
    amount: float,
    clearings: Sequence[Clearing],
    rng: np.random.Generator,
) -> list[Part]:
    """Return traffic islands in the middle of a stretch with their poles; the amount is per 100 m."""
    parts: list[Part] = []
    for s_m in draw_places(stretch_m, amount, rng):
        length_m = float(rng.uniform(3, 8))
        if any(abs(s_m - c.s_m) < c.half_m + length_m for c in clearings):
            continue
        pose = street.upright_pose(road, s_m, 0.0)
        parts.append(Part(meshes.moved(furniture.kerb_island(length_m, 0.7), pose), palette()))
        parts += [
            draw_pole(road, rng, s_m + float(rng.uniform(-0.4, 0.4)) * length_m, 0.0)
            for _ in range(int(rng.integers(1, 5)))
        ]
    return parts
