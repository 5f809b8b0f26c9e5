"""Random positions along a road: parking lots, poles of all sorts, and traffic islands."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from data.synthetic import furniture, meshes, street
from data.synthetic.materials import palette
from data.synthetic.road import Road
from data.synthetic.street import Part
from data.synthetic.town import Clearing

_YARD_M = (12.0, 34.0)


def draw_places(
    stretch_m: tuple[float, float], amount: float, rng: np.random.Generator
) -> list[float]:
    """Draw positions along a stretch; the amount is per 100 m."""
    count = rng.poisson(amount * (stretch_m[1] - stretch_m[0]) / 100)
    return [float(s_m) for s_m in rng.uniform(stretch_m[0] + 4, stretch_m[1] - 4, count)]


@dataclass(frozen=True)
class ParkingLot:
    """A parking lot beside the road.

    Attributes:
        s_m: Start along the road in metres.
        length_m: Length along the road in metres.
        side: Side of the road: 1 left, -1 right.
    """

    s_m: float
    length_m: float
    side: int

    def overlaps(self, s_m: float, length_m: float, side: int) -> bool:
        """Return whether a plot would overlap it."""
        before, after = s_m + length_m <= self.s_m, s_m >= self.s_m + self.length_m
        return side == self.side and not (before or after)


def draw_parking_lots(
    stretch_m: tuple[float, float], amount: float, rng: np.random.Generator
) -> list[ParkingLot]:
    """Draw parking lots along a stretch that do not overlap."""
    parking_lots: list[ParkingLot] = []
    for side in (-1, 1):
        for s_m in draw_places(stretch_m, amount, rng):
            length_m = float(rng.uniform(*_YARD_M))
            if not any(parking_lot.overlaps(s_m, length_m, side) for parking_lot in parking_lots):
                parking_lots.append(ParkingLot(s_m, length_m, side))
    return parking_lots


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
