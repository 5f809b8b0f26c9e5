"""Trucks, buses, trams and trailers: boxes on wheels with cabs, windows and lights.

Origin at the centre of the footprint on the road, x forward, y left, z up.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise

import numpy as np

from data.synthetic import meshes, vehicles
from data.synthetic.materials import Slot
from data.synthetic.meshes import Mesh
from perception.types import Float64

_GLASS_AHEAD_M = 0.012  # panes lie so far before the sheet metal around them


class HeavyKind(Enum):
    """How a heavy vehicle is built."""

    BOX_TRUCK = "box truck"
    FLATBED = "flatbed truck"
    LIGHT_BOX = "light box truck"
    LIGHT_FLATBED = "light flatbed truck"
    ARTICULATED = "articulated truck"
    BUS = "bus"
    TRAILER = "trailer"
    SEMI_TRAILER = "semi-trailer"
    TRAM = "tram"


@dataclass(frozen=True)
class HeavyDesign:
    """Measures of one heavy vehicle in metres.

    Attributes:
        kind: Kind of body.
        length_m: Length from bumper to bumper.
        width_m: Width without mirrors.
        height_m: Height of the roof above the road.
        cab_m: Length of the cab, 0 for none.
        cab_height_m: Height of the cab's roof above the road.
        deck_m: Height of the loading deck, or of a bus's floor.
        wheel_m: Wheel radius.
        axles_m: Positions of the axles along x, the front first.
    """

    kind: HeavyKind
    length_m: float
    width_m: float
    height_m: float
    cab_m: float
    cab_height_m: float
    deck_m: float
    wheel_m: float
    axles_m: tuple[float, ...]

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Length, width, height."""
        return self.length_m, self.width_m, self.height_m


# Length, width, height, cab, cab's height, deck: from and to.
_RANGES_M = {
    HeavyKind.BOX_TRUCK: ((5.6, 9.5), (2.1, 2.55), (2.6, 3.7), (1.7, 2.2), (2.3, 2.9), (0.8, 1.1)),
    HeavyKind.FLATBED: ((5.4, 9.0), (2.05, 2.5), (2.3, 2.9), (1.7, 2.2), (2.3, 2.9), (0.9, 1.2)),
    HeavyKind.LIGHT_BOX: ((4.6, 6.6), (1.7, 2.3), (1.8, 3.1), (1.3, 1.7), (1.85, 2.3), (0.75, 0.95)),
    HeavyKind.LIGHT_FLATBED: ((4.6, 6.2), (1.65, 2.1), (1.85, 2.3), (1.3, 1.7), (1.85, 2.3), (0.75, 0.95)),
    HeavyKind.ARTICULATED: ((13.0, 16.5), (2.5, 2.55), (3.5, 4.0), (2.1, 2.4), (3.0, 3.7), (1.1, 1.25)),
    HeavyKind.BUS: ((10.5, 13.0), (2.5, 2.55), (2.9, 3.3), (0.0, 0.0), (0.0, 0.0), (0.35, 0.5)),
    HeavyKind.TRAILER: ((2.2, 5.5), (1.4, 2.2), (1.1, 2.5), (0.0, 0.0), (0.0, 0.0), (0.45, 0.6)),
    HeavyKind.SEMI_TRAILER: ((9.5, 13.6), (2.5, 2.55), (3.5, 4.0), (0.0, 0.0), (0.0, 0.0), (1.1, 1.25)),
    HeavyKind.TRAM: ((14.0, 22.0), (2.3, 2.65), (3.2, 3.5), (0.0, 0.0), (0.0, 0.0), (0.35, 0.5)),
}  # fmt: skip

_FLATBEDS = (HeavyKind.FLATBED, HeavyKind.LIGHT_FLATBED)
_SMALL_WHEELS = (
    HeavyKind.LIGHT_BOX, HeavyKind.LIGHT_FLATBED, HeavyKind.TRAILER, HeavyKind.TRAM,
)  # fmt: skip


def draw_design(kind: HeavyKind, rng: np.random.Generator) -> HeavyDesign:
    """Draw a vehicle of one kind."""
    ranges = np.array(_RANGES_M[kind])
    length, width, height, cab, cab_height, deck = rng.uniform(ranges[:, 0], ranges[:, 1]).tolist()
    if kind in _FLATBEDS:
        height = cab_height
    cab_height = min(cab_height, height)
    wheel = 0.33 if kind in _SMALL_WHEELS else 0.40 + 0.012 * min(length, 8.0)
    axles = _axles(kind, length, wheel)
    return HeavyDesign(kind, length, width, height, cab, cab_height, deck, wheel, axles)


def _axles(kind: HeavyKind, length_m: float, wheel_m: float) -> tuple[float, ...]:
    half = length_m / 2
    if kind is HeavyKind.TRAILER:
        return (0.0,)
    if kind is HeavyKind.BUS:
        return half - 2.7, -half + 3.3
    apart = 2 * wheel_m + 0.25
    rear = tuple(-half + 1.5 + apart * n for n in range(3))
    if kind is HeavyKind.SEMI_TRAILER:
        return rear
    if kind is HeavyKind.ARTICULATED:
        return half - 1.4, half - 5.0, *rear
    if kind is HeavyKind.TRAM:
        return half - 2.2, half - 4.0, -half + 4.0, -half + 2.2
    return half - 1.2, -half + 0.22 * length_m


def build(design: HeavyDesign) -> Mesh:
    """Build the whole vehicle."""
    wheels = vehicles.wheels(design.axles_m, design.wheel_m, design.width_m)
    return meshes.merge([*_BODIES.get(design.kind, _truck)(design), *wheels])


def _truck(design: HeavyDesign) -> list[Mesh]:
    front = design.length_m / 2 - design.cab_m - 0.15
    return [*_cab(design), _frame(design), *_cargo(design, front), *_tail(design)]


def _trailer(design: HeavyDesign) -> list[Mesh]:
    return [*_cargo(design, design.length_m / 2), *_tail(design)]


def _semi_trailer(design: HeavyDesign) -> list[Mesh]:
    """Build a trailer that stands on its legs."""
    front = 0.3 * design.length_m
    legs = [
        meshes.box((front, y - 0.1, 0.0), (front + 0.25, y + 0.1, design.deck_m), Slot.TRIM)
        for y in (-0.9, 0.9)
    ]
    return [_frame(design), *legs, *_trailer(design)]


def _tram(design: HeavyDesign) -> list[Mesh]:
    """Build cars joined by bellows, skirts down to the rails, a band of windows, and a pantograph."""
    half, side, top = design.length_m / 2, design.width_m / 2, design.height_m
    roof = top - 0.35
    body = _extruded([(-half + 0.25, 0.12), (half - 0.25, 0.12), (half, 0.9), (half - 0.7, roof),
                      (-half + 0.7, roof), (-half, 0.9)], side)  # fmt: skip
    panes = [
        _side_pane(x + 0.1, x + 2.3, 1.15, roof - 0.45, side)
        for x in np.arange(-half + 1.2, half - 3.2, 2.4).tolist()
    ]
    low, high = 1.15, roof - 0.25
    slant = 0.7 / (roof - 0.9)
    ends = [
        _front_pane(
            (
                sign * (half + _GLASS_AHEAD_M - slant * (low - 0.9)),
                sign * (half + _GLASS_AHEAD_M - slant * (high - 0.9)),
            ),
            low,
            high,
            side - 0.15,
        )
        for sign in (1, -1)
    ]
    bellows = [
        meshes.box((x - 0.35, -side - 0.015, 0.3), (x + 0.35, side + 0.015, roof), Slot.TRIM)
        for x in (-design.length_m / 6, design.length_m / 6)
    ]
    gear = meshes.box((-half + 3.0, -0.8, roof), (half - 3.0, 0.8, roof + 0.2), Slot.TRIM)
    bow = [
        meshes.tube((0.0, y, roof), (0.9, y, top - 0.03), (0.03, 0.03), Slot.METAL, 5)
        for y in (-0.5, 0.5)
    ]
    bar = meshes.tube((0.9, -0.8, top - 0.03), (0.9, 0.8, top - 0.03), (0.03, 0.03), Slot.METAL, 5)
    return [body, *panes, *ends, *bellows, gear, *bow, bar]


def _bus(design: HeavyDesign) -> list[Mesh]:
    """Build the body with a row of windows at each side, a door-high windscreen and a rear window."""
    half, side, top = design.length_m / 2, design.width_m / 2, design.height_m
    body = _extruded([(-half, 0.32), (half, 0.32), (half, 1.1), (half - 0.12, top - 0.25),
                      (half - 0.35, top), (-half + 0.1, top), (-half, top - 0.3)], side)  # fmt: skip
    x = np.linspace(-half + 0.5, half - 1.7, max(4, round(design.length_m / 1.6)))
    panes = [
        _side_pane(a + 0.05, b - 0.05, 1.25, top - 0.65, side) for a, b in pairwise(x.tolist())
    ]
    doors = [_side_pane(a, a + 1.2, 0.45, top - 0.55, side, (-1,)) for a in (half - 1.5, -0.6)]
    windscreen = _front_pane((half + 0.01, half - 0.09), 1.05, top - 0.35, side - 0.12)
    rear = _front_pane((-half - 0.01, -half - 0.01), 1.4, top - 0.6, side - 0.25)
    # Seats and people, which a laser meets behind the panes.
    seats = meshes.box(
        (-half + 0.6, -side + 0.35, 0.5), (half - 2.0, side - 0.35, 1.35), Slot.INTERIOR
    )
    return [body, *panes, *doors, windscreen, rear, seats, *_lights(design), *_tail(design)]


def _cab(design: HeavyDesign) -> list[Mesh]:
    half, side, top = design.length_m / 2, design.width_m / 2, design.cab_height_m
    back = half - design.cab_m
    belt = 0.45 * top + 0.25
    body = _extruded([(back, 0.5), (half, 0.45), (half, belt), (half - 0.22, top - 0.12),
                      (half - 0.4, top), (back, top)], side)  # fmt: skip
    windscreen = _front_pane((half + 0.01, half - 0.19), belt + 0.05, top - 0.2, side - 0.1)
    pane = _side_pane(half - 1.25, half - 0.35, belt + 0.05, min(belt + 0.85, top - 0.15), side)
    mirrors = [
        meshes.box((half - 0.3, y - 0.1, belt + 0.1), (half - 0.2, y + 0.1, belt + 0.8), Slot.TRIM)
        for y in (side + 0.05, -side - 0.05)
    ]
    return [body, windscreen, pane, *mirrors, *_lights(design)]


def _frame(design: HeavyDesign) -> Mesh:
    """Build the girders, tanks and guards under the deck."""
    half, side = design.length_m / 2, design.width_m / 2
    girders = meshes.box((-half, -0.45, 0.55), (half - 1.0, 0.45, design.deck_m), Slot.TRIM)
    gap = (min(design.axles_m) + 0.9, max(design.axles_m) - 0.9)
    if gap[1] - gap[0] < 0.5:
        return girders
    tank = meshes.box((gap[0], -side + 0.12, 0.45), (gap[1], side - 0.12, 0.9), Slot.TRIM)
    return meshes.merge([girders, tank])


def _cargo(design: HeavyDesign, front_m: float) -> list[Mesh]:
    """Build what is behind the cab: a box, or a deck between low walls."""
    half, side, low = design.length_m / 2, design.width_m / 2, design.deck_m
    if design.kind not in _FLATBEDS:
        box = meshes.box((-half, -side, low), (front_m, side, design.height_m), Slot.CARGO)
        return [meshes.textured(box, box.vertices_m[:, [0, 2]])]
    high = low + 0.45
    walls = [
        meshes.box((-half, -side, low), (front_m, -side + 0.05, high), Slot.CARGO),
        meshes.box((-half, side - 0.05, low), (front_m, side, high), Slot.CARGO),
        meshes.box((-half, -side, low), (-half + 0.05, side, high), Slot.CARGO),
        meshes.box((front_m - 0.05, -side, low), (front_m, side, design.height_m), Slot.CARGO),
    ]
    deck = meshes.box((-half, -side, low - 0.1), (front_m, side, low), Slot.CARGO)
    load = meshes.box(
        (-half + 0.6, -side + 0.4, low), (0.3 * front_m, side - 0.3, low + 0.7), Slot.CARGO
    )
    return [*walls, deck, load]


def _lights(design: HeavyDesign) -> list[Mesh]:
    half, side = design.length_m / 2, design.width_m / 2
    return [
        meshes.box((half - 0.05, y - 0.2, 0.6), (half + 0.01, y + 0.2, 0.8), Slot.HEADLIGHT)
        for y in (side - 0.3, 0.3 - side)
    ] + [_plate(half + 0.015, 0.5, 1)]


def _tail(design: HeavyDesign) -> list[Mesh]:
    """Build a bumper with its lights and plate."""
    half, side = design.length_m / 2, design.width_m / 2
    bumper = meshes.box(
        (-half + 0.01, -side + 0.1, 0.45), (-half + 0.12, side - 0.1, 0.75), Slot.TRIM
    )
    lights = [
        meshes.box((-half - 0.01, y - 0.15, 0.52), (-half + 0.02, y + 0.15, 0.68), Slot.TAILLIGHT)
        for y in (side - 0.3, 0.3 - side)
    ]
    return [bumper, *lights, _plate(-half - 0.015, 0.54, -1)]


def _plate(x_m: float, low_m: float, facing: int) -> Mesh:
    across, up = np.array([-0.26, 0.26, 0.26, -0.26]), np.array([0.0, 0.0, 0.11, 0.11])
    corners = np.stack([np.full(4, x_m), facing * across, low_m + up], axis=1)
    face = meshes.quads(corners[None], Slot.PLATE)
    return meshes.textured(face, np.stack([across / 0.52 + 0.5, up / 0.11], axis=1))


def _extruded(profile_m: Sequence[tuple[float, float]], side_m: float) -> Mesh:
    """Draw a convex outline in x and z out to both sides, and close them."""
    outline = np.array(profile_m)
    closed = np.concatenate([outline, outline[:1]])
    rows = [
        np.column_stack([closed[:, 0], np.full(len(closed), y), closed[:, 1]])
        for y in (-side_m, side_m)
    ]
    shell = meshes.grid(np.stack(rows), Slot.PAINT)
    fan = np.array([[0, n, n + 1] for n in range(1, len(outline) - 1)])
    sides = [meshes.make(row[:-1], fan, Slot.PAINT) for row in rows]
    return meshes.merge([shell, *sides])


def _side_pane(
    rear_m: float,
    front_m: float,
    low_m: float,
    high_m: float,
    side_m: float,
    sides: Sequence[int] = (-1, 1),
) -> Mesh:
    """Build a pane at one side or both."""
    corners: list[Float64] = []
    for sign in sides:
        y = sign * (side_m + _GLASS_AHEAD_M)
        corners.append(
            np.array(
                [[rear_m, y, low_m], [front_m, y, low_m], [front_m, y, high_m], [rear_m, y, high_m]]
            )
        )
    return meshes.quads(np.stack(corners), Slot.GLASS)


def _front_pane(x_m: tuple[float, float], low_m: float, high_m: float, side_m: float) -> Mesh:
    """Build a pane across, given x at its lower and its upper edge."""
    low, high = x_m
    corners = [
        [low, -side_m, low_m],
        [low, side_m, low_m],
        [high, side_m, high_m],
        [high, -side_m, high_m],
    ]
    return meshes.quads(np.array([corners]), Slot.GLASS)


# How the kinds that are no trucks are built.
_BODIES = {
    HeavyKind.BUS: _bus,
    HeavyKind.TRAILER: _trailer,
    HeavyKind.SEMI_TRAILER: _semi_trailer,
    HeavyKind.TRAM: _tram,
}
