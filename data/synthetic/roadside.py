"""Random positions along a road: plots beside it, poles of all sorts, and traffic islands."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from data.synthetic import furniture, meshes, street, vegetation
from data.synthetic.materials import palette
from data.synthetic.road import Road
from data.synthetic.street import Part
from data.synthetic.town import Clearing, IsFree
from perception.types import Float64

_ISLAND_ROOM_M = 3.2  # width that vehicles need of a lane beside an island
_MIN_ISLAND_M = 0.4


def draw_places(
    stretch_m: tuple[float, float], amount: float, rng: np.random.Generator
) -> list[float]:
    """Draw positions along a stretch; the amount is per 100 m."""
    count = rng.poisson(amount * (stretch_m[1] - stretch_m[0]) / 100)
    return [float(s_m) for s_m in rng.uniform(stretch_m[0] + 4, stretch_m[1] - 4, count)]


@dataclass(frozen=True)
class Plot:
    """A stretch of one side of the road that is kept for something, as a parking lot.

    Attributes:
        s_m: Start along the road in metres.
        length_m: Length along the road in metres.
        side: Side of the road: 1 left, -1 right.
    """

    s_m: float
    length_m: float
    side: int

    @property
    def middle_m(self) -> float:
        """Middle along the road in metres."""
        return self.s_m + self.length_m / 2

    def overlaps(self, s_m: float, length_m: float, side: int) -> bool:
        """Return whether a plot would overlap it."""
        before, after = s_m + length_m <= self.s_m, s_m >= self.s_m + self.length_m
        return side == self.side and not (before or after)


def draw_plots(
    stretch_m: tuple[float, float],
    amount: float,
    lengths_m: tuple[float, float],
    rng: np.random.Generator,
) -> list[Plot]:
    """Draw plots along a stretch that do not overlap, their lengths between two limits."""
    plots: list[Plot] = []
    for side in (-1, 1):
        for s_m in draw_places(stretch_m, amount, rng):
            length_m = float(rng.uniform(*lengths_m))
            if not any(plot.overlaps(s_m, length_m, side) for plot in plots):
                plots.append(Plot(s_m, length_m, side))
    return plots


def land_outside(plots: Sequence[Plot]) -> IsFree:
    """Return the function that tells whether a stretch of one side overlaps no plot."""
    return lambda s_m, length_m, side: not any(p.overlaps(s_m, length_m, side) for p in plots)


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
    """Return traffic islands in the middle of a stretch; the amount is per 100 m.

    They are as wide as the lanes allow, and hold poles, low signs at their ends, and plants.
    """
    width_m = min(road.shape.lane_m - _ISLAND_ROOM_M, 1.6)
    parts: list[Part] = []
    for s_m in draw_places(stretch_m, amount, rng):
        length_m = float(rng.uniform(3, 10))
        is_clear = all(abs(s_m - c.s_m) > c.half_m + length_m for c in clearings)
        if is_clear and width_m >= _MIN_ISLAND_M:
            parts += _island(road, s_m, np.array([length_m, width_m]), rng)
    return parts


def _island(road: Road, s_m: float, size_m: Float64, rng: np.random.Generator) -> list[Part]:
    """Build one island of a length and width with what stands on it."""
    length_m, width_m = size_m.tolist()
    pose = street.sloped_pose(road, s_m, 0.0)
    parts = [Part(meshes.moved(furniture.kerb_island(length_m, width_m), pose), palette())]
    parts += [
        draw_pole(road, rng, s_m + float(rng.uniform(-0.4, 0.4)) * length_m, 0.0)
        for _ in range(int(rng.integers(1, 5)))
    ]
    if rng.random() < 0.6:
        ends = (-1, 1) if rng.random() < 0.7 else (-1,)
        turns = [
            street.upright_pose(road, s_m + end * (length_m / 2 - 0.35), 0.0, np.pi * (end > 0))
            for end in ends
        ]
        appearance = furniture.keep_right_palette(rng)
        sign = furniture.keep_right_sign(float(rng.uniform(0.7, 1.3)))
        parts += [Part(meshes.moved(sign, turn), appearance) for turn in turns]
    if width_m > 0.7 and rng.random() < 0.5:
        bush = vegetation.block([0.7 * length_m, 0.75 * width_m, float(rng.uniform(0.35, 1.2))])
        parts.append(
            Part(meshes.moved(vegetation.trimmed(bush, rng), pose), vegetation.foliage_palette(rng))
        )
    return parts
