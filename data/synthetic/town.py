"""Lay out a street: plots of houses and gardens, and furniture along the kerb."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from data.synthetic import furniture, meshes, street, vegetation
from data.synthetic.materials import SemanticClass, Slot, palette
from data.synthetic.meshes import Mesh
from data.synthetic.road import Road
from data.synthetic.street import Part
from perception.types import Float32, Float64


@dataclass(frozen=True)
class TownConfig:
    """Buildings, vegetation and furniture of a street; shares from 0 to 1.

    Attributes:
        houses: Share of plots with a house at the pavement's edge.
        greenery: Share of kerbside places with a tree, and of gardens with a hedge.
        furniture: Share of kerbside places with a lamp, sign or bollard.
        parking: Share of parking places taken, where there is a parking lane.
        parking_rad: Angle of the vehicles in the parking lanes to the road in radians.
        borders: Share of gardens with a hedge, fence or wall towards the pavement.
        lamps: Share of the lamps' places with one.
        backdrop: Share of places behind the houses with a tall tree.
        low_crowns: Share of trees whose leaves reach down to the ground.
        gardens: Share of the plots without a house that have a garden.
        leaves: Number of leaves of a tree.
        ground_reflectance: Reflectance of road and land relative to the usual.
    """

    houses: float = 0.65
    greenery: float = 0.4
    furniture: float = 0.75
    parking: float = 0.55
    parking_rad: float = 0.0
    borders: float = 1.0
    lamps: float = 1.0
    backdrop: float = 1.0
    low_crowns: float = 0.0
    gardens: float = 1.0
    leaves: int = 1700
    ground_reflectance: float = 1.0


# Whether the land beside the road is free, by start and length along it in metres, and side.
IsFree = Callable[[float, float, int], bool]


def is_always_free(s_m: float, length_m: float, side: int) -> bool:
    """Return that all land is free."""
    del s_m, length_m, side
    return True


@dataclass(frozen=True)
class Clearing:
    """A stretch of road without objects, as where pedestrians cross.

    Attributes:
        s_m: Middle of the stretch in metres along the road.
        half_m: Half its length in metres.
    """

    s_m: float
    half_m: float


def lay_out_street(
    road: Road,
    stretch_m: tuple[float, float],
    config: TownConfig,
    clearings: list[Clearing],
    rng: np.random.Generator,
    is_free: IsFree = is_always_free,
) -> list[Part]:
    """Return the ground of a stretch, its buildings, vegetation and furniture.

    Args:
        road: Road.
        stretch_m: Start and end of the stretch in metres.
        config: Configuration of the town.
        clearings: Stretches where nothing may be placed.
        rng: Random generator of positions and shapes.
        is_free: Function that tells whether a plot may be built on, by its start, length and side.
    """
    parts = [street.ground(road, *stretch_m, _ground_palette(config))]
    for side in (-1, 1):
        roadside = _Roadside(road, side, config, rng)
        parts += roadside.plots(*stretch_m, is_free)
        parts += roadside.kerbside(*stretch_m, clearings)
        parts += roadside.backdrop(*stretch_m)
    return parts


def _ground_palette(config: TownConfig) -> Float32:
    appearance = palette()
    appearance[[Slot.ASPHALT, Slot.PAVEMENT, Slot.KERB, Slot.GRASS], 3] *= config.ground_reflectance
    return appearance


@dataclass(frozen=True)
class _Roadside:
    """One side of a road, to be built up.

    Attributes:
        road: Road.
        side: Side of the road: 1 left, -1 right.
        config: Configuration of the town.
        rng: Random generator of positions and shapes.
    """

    road: Road
    side: int
    config: TownConfig
    rng: np.random.Generator

    @property
    def _edge_m(self) -> float:
        """Outer edge of the pavement."""
        return self.road.shape.half_width_m + self.road.shape.pavement_m

    def plots(self, start_m: float, end_m: float, is_free: IsFree) -> list[Part]:
        """Fill the land behind the pavement with houses and gardens, plot after plot."""
        parts: list[Part] = []
        s = start_m
        while s < end_m - 8:
            length = float(self.rng.uniform(9, 17))
            if is_free(s, length, self.side):
                parts += self._plot(s, length)
            s += length + float(self.rng.choice([0.3, 0.3, 3.5]))
        return parts

    def _plot(self, s_m: float, length_m: float) -> list[Part]:
        if self.rng.random() >= self.config.houses:
            parts = self._border(s_m, length_m)
            if not self._lacks(self.config.gardens):
                parts += self._garden(s_m, length_m)
            return parts
        front_garden_m = float(self.rng.choice([0.0, 0.0, 3.0]))
        house = self._house(s_m, length_m, self._edge_m + 0.3 + front_garden_m)
        return [house, *self._border(s_m, length_m)] if front_garden_m > 0 else [house]

    def _along(self, s_m: float, length_m: float, edge_m: float) -> Float64:
        return street.facade_pose(self.road, s_m, length_m, self.side * edge_m)

    def _house(self, s_m: float, length_m: float, edge_m: float) -> Part:
        floors = int(self.rng.choice([2, 2, 3, 3, 4]))
        mesh = street.house(length_m, floors, self.rng)
        pose = self._along(s_m, length_m, edge_m)
        return Part(meshes.moved(mesh, pose), street.house_palette(self.rng))

    def _border(self, s_m: float, length_m: float) -> list[Part]:
        """Close a plot off towards the pavement by a hedge, a fence or a low wall."""
        if self._lacks(self.config.borders):
            return []
        pose = self._along(s_m, length_m, self._edge_m + 0.7)
        height, kind = float(self.rng.uniform(0.8, 1.7)), self.rng.random()
        if kind < self.config.greenery:
            hedge = vegetation.hedge(length_m, height, self.rng)
            return [Part(meshes.moved(hedge, pose), vegetation.foliage_palette(self.rng))]
        if kind < 0.85:
            fence = furniture.fence(length_m, min(height, 1.3))
            return [Part(meshes.moved(fence, pose), palette())]
        wall = meshes.moved(furniture.garden_wall(length_m, min(height, 1.1)), pose)
        return [Part(wall, street.house_palette(self.rng), SemanticClass.FENCE)]

    def _lacks(self, share: float) -> bool:
        """Draw whether one of many is missing; no number is drawn for a share of 0 or 1."""
        return share <= 0 or (share < 1 and self.rng.random() >= share)

    def _garden(self, s_m: float, length_m: float) -> list[Part]:
        count = 1 + int(self.rng.random() < self.config.greenery)
        return [
            self._tree(
                s_m + float(self.rng.uniform(1, length_m - 1)),
                self._edge_m + float(self.rng.uniform(3, 9)),
                float(self.rng.uniform(5, 10)),
            )
            for _ in range(count)
        ]

    def _tree(self, s_m: float, out_m: float, height_m: float) -> Part:
        # A crown that reaches the ground must not reach the pavement.
        has_room = out_m - self._edge_m > vegetation.CROWN_REACH * height_m
        is_low = has_room and not self._lacks(self.config.low_crowns)
        mesh = vegetation.tree(height_m, self.rng, self.config.leaves, is_low=is_low)
        pose = street.upright_pose(
            self.road, s_m, self.side * out_m, float(self.rng.uniform(0, 6.28))
        )
        return Part(meshes.moved(mesh, pose), vegetation.foliage_palette(self.rng))

    def kerbside(self, start_m: float, end_m: float, clearings: list[Clearing]) -> list[Part]:
        """Stand lamps, signs, bollards and trees in a row behind the kerb."""
        parts: list[Part] = []
        row_m = self.road.shape.half_width_m + 0.5
        places = np.arange(start_m + 3, end_m - 3, 6.5) + self.rng.uniform(0, 3)
        for number, place in enumerate(places):
            s_m = float(place + self.rng.uniform(-1.5, 1.5))
            if any(abs(s_m - clearing.s_m) < clearing.half_m for clearing in clearings):
                continue
            if number % 4 == 0:
                if self._lacks(self.config.lamps):
                    continue
                parts.append(self._facing_traffic(self._lamp(), palette(), s_m, row_m))
            elif self.rng.random() < self.config.furniture * 0.6:
                parts.append(self._facing_traffic(*self._post(), s_m, row_m))
            elif self.rng.random() < self.config.greenery:
                parts.append(self._tree(s_m, row_m, float(self.rng.uniform(5, 9))))
        return parts

    def _facing_traffic(self, mesh: Mesh, appearance: Float32, s_m: float, out_m: float) -> Part:
        """Place an object with its -x towards the traffic of this side, its y over the road."""
        turn = np.pi if self.side > 0 else 0.0
        pose = street.upright_pose(self.road, s_m, self.side * out_m, turn)
        return Part(meshes.moved(mesh, pose), appearance)

    def _lamp(self) -> Mesh:
        return furniture.lamp(
            float(self.rng.uniform(5, 8)), float(self.rng.uniform(0.04, 0.05)), 1.2
        )

    def _post(self) -> tuple[Mesh, Float32]:
        """Draw a sign, or a bollard."""
        if self.rng.random() < 0.6:
            kind = int(self.rng.choice([0, 0, 1, 2, 2, 3]))
            return furniture.sign(kind, 0.03), furniture.sign_palette(kind, self.rng)
        height, radius = float(self.rng.uniform(0.9, 1.1)), float(self.rng.uniform(0.025, 0.05))
        return furniture.bollard(height, radius), palette()

    def backdrop(self, start_m: float, end_m: float) -> list[Part]:
        """Stand a loose row of tall trees behind the houses."""
        return [
            self._tree(
                float(s + self.rng.uniform(-5, 5)),
                self._edge_m + float(self.rng.uniform(17, 30)),
                float(self.rng.uniform(9, 15)),
            )
            for s in np.arange(start_m, end_m, 14.0)
            if not self._lacks(self.config.backdrop)
        ]
