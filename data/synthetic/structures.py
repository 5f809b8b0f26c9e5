"""Things as large as vehicles that stand beside a street: kiosks, cabins, containers, skips.

All stand at the origin, their middle over it, x along the road, their front towards -y.
"""

from dataclasses import dataclass

import numpy as np

from data.synthetic import meshes, street
from data.synthetic.materials import CARGO_PAINTS, Slot, palette, random_paint
from data.synthetic.meshes import Mesh
from data.synthetic.road import Road
from data.synthetic.street import Part
from perception.types import Float32, Float64

_WALL_M, _VAULT_M = 3.6, 2.0  # height of the walls, and of the vault over them
_BEYOND_M = 0.3  # of the walls beyond the pavements
_LAMPS = 0.03  # light of the tunnel's lamps as a share of the sky's
_DAYLIGHT_M = 7.0  # depth into the tunnel at which a third of the daylight is left
_ARC_RAD = np.linspace(0, np.pi, 9)
_LAMP_EVERY_M, _LAMP_Z_M = 8.0, _WALL_M + _VAULT_M - 0.35
_LAMP = meshes.box((-0.8, -0.12, _LAMP_Z_M), (0.8, 0.12, _LAMP_Z_M + 0.1), Slot.HEADLIGHT)
# Lamps shine as paint does that is so much brighter than white, in their own faint light; and reflectance.
_LAMP_COLOUR = (200.0, 190.0, 160.0, 0.7)
_RIB_M = 0.14  # from one rib of a container's wall to the next


@dataclass(frozen=True)
class Tunnel:
    """A tunnel over a stretch of road.

    Attributes:
        road: Road.
        start_m: Position of its entrance along the road.
        end_m: Position of its exit.
    """

    road: Road
    start_m: float
    end_m: float

    @property
    def _half_m(self) -> float:
        """From the road's centreline to a wall."""
        return self.road.shape.outer_m + _BEYOND_M

    def parts(self) -> list[Part]:
        """Return the walls with the vault, and the lamps under it."""
        lamps = [
            meshes.moved(_LAMP, street.sloped_pose(self.road, s_m, 0.0))
            for s_m in np.arange(self.start_m + _LAMP_EVERY_M, self.end_m, _LAMP_EVERY_M)
        ]
        bright = palette({Slot.HEADLIGHT: _LAMP_COLOUR})
        return [self._walls(), *([Part(meshes.merge(lamps), bright)] if lamps else [])]

    def _walls(self) -> Part:
        side = np.r_[self._half_m, self._half_m * np.cos(_ARC_RAD), -self._half_m]
        height = np.r_[-0.5, _WALL_M + _VAULT_M * np.sin(_ARC_RAD), -0.5]
        stations = np.arange(self.start_m, self.end_m + 1.0, 2.0)
        s, across = np.meshgrid(stations, side, indexing="ij")
        places = self.road.place(s, across)
        places[..., 2] = self.road.place(s, 0 * across)[..., 2] + height
        return Part(meshes.smooth(meshes.grid(places, Slot.CONCRETE)), palette())

    def daylight_share(self, points_m: Float32) -> Float32:
        """Return (K,) the share of the sky's light at places of the world, that of the lamps included."""
        s, side = self.road.locate(points_m[:, :2].astype(float))
        depth = np.minimum(s - self.start_m, self.end_m - s)
        share = np.maximum(np.exp(-np.maximum(depth, 0.0) / _DAYLIGHT_M), _LAMPS)
        return np.where(np.abs(side) < self._half_m + 0.1, share, 1.0).astype(np.float32)


def kiosk(rng: np.random.Generator) -> Mesh:
    """Build a kiosk: a box with an open counter under an awning, and a roof that reaches over it."""
    length, depth, height = rng.uniform([1.8, 1.6, 2.3], [4.8, 2.8, 3.1]).tolist()
    half, front = length / 2, -depth / 2
    body = meshes.box((-half, front, -0.3), (half, depth / 2, height), Slot.PANEL)
    roof = meshes.box(
        (-half - 0.2, front - 0.35, height),
        (half + 0.2, depth / 2 + 0.2, height + 0.16),
        Slot.CARGO,
    )
    counter = _pane((-half + 0.25, half - 0.25), front - 0.012, (1.0, height - 0.35))
    shelf = meshes.box((-half + 0.1, front - 0.3, 0.92), (half - 0.1, front, 0.98), Slot.CARGO)
    awning = meshes.quads(
        np.array([[(-half, front, height - 0.25), (half, front, height - 0.25),
                   (half, front - 0.8, height - 0.55), (-half, front - 0.8, height - 0.55)]]),
        Slot.CARGO,
    )  # fmt: skip
    return meshes.merge([body, roof, counter, shelf, awning])


def cabin(rng: np.random.Generator) -> Mesh:
    """Build a cabin of a building site, on feet, with windows and a door."""
    length, depth, height = float(rng.choice([3.0, 6.06])), 2.44, 2.75
    half, front, low = length / 2, -depth / 2, float(rng.uniform(0.05, 0.35))
    body = meshes.box((-half, front, low), (half, depth / 2, low + height), Slot.CARGO)
    feet = [
        meshes.box((x, y, -0.3), (x + 0.25, y + 0.25, low), Slot.CONCRETE)
        for x in (-half, half - 0.25)
        for y in (front, depth / 2 - 0.25)
    ]
    windows = [
        _pane((x - 0.5, x + 0.5), front - 0.012, (low + 1.0, low + 2.0))
        for x in np.arange(-half + 0.8, half - 1.4, 1.7)
    ]
    door = meshes.box(
        (half - 1.2, front - 0.02, low + 0.05), (half - 0.3, front, low + 2.1), Slot.PANEL
    )
    return meshes.merge([body, *feet, *windows, door])


def container(rng: np.random.Generator) -> Mesh:
    """Build a freight container with ribbed walls."""
    length, width, height = float(rng.choice([6.06, 6.06, 12.19])), 2.44, 2.59
    x = np.arange(-length / 2, length / 2 + 1e-6, _RIB_M / 2)
    depth = 0.036 * (np.arange(len(x)) // 2 % 2)
    walls = [
        meshes.grid(
            np.stack(
                np.broadcast_arrays(
                    x, side * (width / 2 - depth), np.array([0.1, height - 0.1])[:, None]
                ),
                axis=-1,
            ),
            Slot.CARGO,
        )
        for side in (-1, 1)
    ]
    half, out = length / 2, width / 2
    beams = [
        meshes.box((-half, y, z), (half, y + 0.12, z + 0.12), Slot.CARGO)
        for y in (-out, out - 0.12)
        for z in (0.0, height - 0.12)
    ]
    ends = [
        meshes.box((end - 0.03, -out, 0.0), (end + 0.03, out, height), Slot.CARGO)
        for end in (-half, half)
    ]
    roof = meshes.box((-half, -out, height - 0.05), (half, out, height), Slot.CARGO)
    return meshes.merge([*walls, *beams, *ends, roof])


def skip(rng: np.random.Generator) -> Mesh:
    """Build an open container for rubble, its ends slanting outwards."""
    length, width, height = rng.uniform([2.6, 1.6, 1.0], [4.6, 1.9, 1.7]).tolist()
    foot, half = 0.32 * length, length / 2
    outline = np.array([[-half, height], [-foot, 0.05], [foot, 0.05], [half, height]])
    rows = [
        np.column_stack([outline[:, 0], np.full(4, y), outline[:, 1]])
        for y in (-width / 2, width / 2)
    ]
    sides = [meshes.make(row, np.array([[0, 1, 2], [0, 2, 3]]), Slot.CARGO) for row in rows]
    level = 0.75 * height
    rubble = meshes.box((-foot, -width / 2, 0.1), (foot, width / 2, level), Slot.CONCRETE)
    return meshes.merge([meshes.grid(np.stack(rows), Slot.CARGO), *sides, rubble])


STRUCTURES = (kiosk, kiosk, cabin, container, container, skip)


def paint(rng: np.random.Generator) -> Float32:
    """Draw the colours of a structure."""
    panel = random_paint(rng, CARGO_PAINTS)
    return palette({Slot.PANEL: panel, Slot.CARGO: random_paint(rng, CARGO_PAINTS)})


def _pane(x_m: tuple[float, float], y_m: float, z_m: tuple[float, float]) -> Mesh:
    """Build an upright pane of glass along x."""
    corners: Float64 = np.array(
        [[(x, y_m, z) for x, z in zip((*x_m, *x_m[::-1]), np.repeat(z_m, 2), strict=True)]]
    )
    return meshes.quads(corners, Slot.WINDOW)
