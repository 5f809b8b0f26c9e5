"""Materials: their reflectance, colour and semantic class.

A mesh names a `Slot` for every triangle; an object's palette gives each slot its colour and
reflectance, so that one car shape is painted a hundred ways.
"""

from enum import IntEnum, auto
from typing import NamedTuple

import numpy as np

from perception.types import Float32


class Slot(IntEnum):
    """Material of a triangle."""

    ASPHALT = 0
    KERB = auto()
    PAVEMENT = auto()
    GRASS = auto()
    WALL = auto()
    WINDOW = auto()
    FRAME = auto()
    CURTAIN = auto()
    ROOF = auto()
    DOOR = auto()
    TRUNK = auto()
    LEAVES = auto()
    FENCE = auto()
    METAL = auto()
    SIGN = auto()
    SIGN_BACK = auto()
    PAINT = auto()
    GLASS = auto()
    TRIM = auto()
    TYRE = auto()
    RIM = auto()
    HEADLIGHT = auto()
    TAILLIGHT = auto()
    PLATE = auto()
    INTERIOR = auto()
    SKIN = auto()
    HAIR = auto()
    SHIRT = auto()
    TROUSERS = auto()
    SHOES = auto()
    BICYCLE = auto()
    RAIL = auto()
    WIRE = auto()
    CONCRETE = auto()
    PANEL = auto()
    SIGNAL = auto()
    CARGO = auto()


class SemanticClass(IntEnum):
    """SemanticKITTI's numbers of the classes that a synthetic street holds."""

    CAR = 10
    ON_RAILS = 16
    TRUCK = 18
    OTHER_VEHICLE = 20
    PERSON = 30
    BICYCLIST = 31
    MOTORCYCLIST = 32
    ROAD = 40
    SIDEWALK = 48
    BUILDING = 50
    FENCE = 51
    OTHER_STRUCTURE = 52
    VEGETATION = 70
    TRUNK = 71
    TERRAIN = 72
    POLE = 80
    TRAFFIC_SIGN = 81
    OTHER_OBJECT = 99


# Still class: its number while the object moves.
MOVING_CLASS = {
    SemanticClass.CAR: 252,
    SemanticClass.BICYCLIST: 253,
    SemanticClass.PERSON: 254,
    SemanticClass.MOTORCYCLIST: 255,
    SemanticClass.ON_RAILS: 256,
    SemanticClass.TRUCK: 258,
    SemanticClass.OTHER_VEHICLE: 259,
}


class Material(NamedTuple):
    """One slot's defaults.

    Attributes:
        rgb: Linear colour, 0..1.
        reflectance: Reflectance that a LiDAR reports face on, 0..1, as in KITTI's scans.
        semantic: Class of static surfaces with this slot; objects such as cars override it.
        gloss: Share of the sky that it mirrors face on.
        drop: Share of laser returns lost whatever the range.
        transmission: Share of laser shots that go through it.
    """

    rgb: tuple[float, float, float]
    reflectance: float
    semantic: int = 0
    gloss: float = 0.0
    drop: float = 0.01
    transmission: float = 0.0


MATERIALS = {
    Slot.ASPHALT: Material((0.17, 0.17, 0.175), 0.48, SemanticClass.ROAD),
    Slot.KERB: Material((0.42, 0.41, 0.39), 0.46, SemanticClass.SIDEWALK),
    Slot.PAVEMENT: Material((0.33, 0.31, 0.30), 0.46, SemanticClass.SIDEWALK),
    Slot.GRASS: Material((0.075, 0.10, 0.034), 0.52, SemanticClass.TERRAIN, drop=0.04),
    Slot.WALL: Material((0.50, 0.46, 0.40), 0.40, SemanticClass.BUILDING),
    Slot.WINDOW: Material(
        (0.03, 0.04, 0.05), 0.10, SemanticClass.BUILDING, gloss=0.35, drop=0.35, transmission=0.6
    ),
    Slot.FRAME: Material((0.72, 0.72, 0.70), 0.42, SemanticClass.BUILDING),
    Slot.CURTAIN: Material((0.20, 0.19, 0.18), 0.25, SemanticClass.BUILDING),
    Slot.ROOF: Material((0.26, 0.10, 0.07), 0.30, SemanticClass.BUILDING),
    Slot.DOOR: Material((0.16, 0.09, 0.05), 0.30, SemanticClass.BUILDING),
    Slot.TRUNK: Material((0.12, 0.09, 0.07), 0.30, SemanticClass.TRUNK),
    Slot.LEAVES: Material((0.055, 0.085, 0.024), 0.50, SemanticClass.VEGETATION, drop=0.05),
    Slot.FENCE: Material((0.30, 0.24, 0.18), 0.35, SemanticClass.FENCE),
    Slot.METAL: Material((0.30, 0.31, 0.32), 0.35, SemanticClass.POLE, gloss=0.05),
    Slot.SIGN: Material((0.75, 0.75, 0.75), 0.99, SemanticClass.TRAFFIC_SIGN),
    Slot.SIGN_BACK: Material((0.35, 0.36, 0.37), 0.40, SemanticClass.TRAFFIC_SIGN),
    Slot.PAINT: Material((0.30, 0.30, 0.32), 0.30, gloss=0.06, drop=0.03),
    Slot.GLASS: Material((0.010, 0.012, 0.013), 0.06, gloss=0.03, drop=0.85, transmission=0.45),
    Slot.TRIM: Material((0.025, 0.025, 0.027), 0.08, gloss=0.02, drop=0.06),
    Slot.TYRE: Material((0.03, 0.03, 0.03), 0.10, drop=0.05),
    Slot.RIM: Material((0.42, 0.43, 0.45), 0.45, gloss=0.12, drop=0.03),
    Slot.HEADLIGHT: Material((0.70, 0.72, 0.75), 0.65, gloss=0.20, drop=0.10),
    Slot.TAILLIGHT: Material((0.40, 0.02, 0.02), 0.85, gloss=0.08, drop=0.03),
    Slot.PLATE: Material((0.78, 0.78, 0.74), 0.97),
    Slot.INTERIOR: Material((0.04, 0.04, 0.045), 0.20, drop=0.6),
    Slot.SKIN: Material((0.55, 0.36, 0.27), 0.45),
    Slot.HAIR: Material((0.06, 0.04, 0.03), 0.15, drop=0.05),
    Slot.SHIRT: Material((0.30, 0.30, 0.35), 0.35),
    Slot.TROUSERS: Material((0.06, 0.07, 0.12), 0.25),
    Slot.SHOES: Material((0.05, 0.045, 0.04), 0.20),
    Slot.BICYCLE: Material(
        (0.08, 0.08, 0.09), 0.25, SemanticClass.OTHER_OBJECT, gloss=0.03, drop=0.05
    ),
    Slot.RAIL: Material((0.30, 0.31, 0.32), 0.35, SemanticClass.FENCE, gloss=0.05),
    Slot.WIRE: Material((0.10, 0.14, 0.10), 0.25, SemanticClass.FENCE, drop=0.2, transmission=0.5),
    Slot.CONCRETE: Material((0.38, 0.37, 0.35), 0.40, SemanticClass.OTHER_STRUCTURE),
    Slot.PANEL: Material((0.30, 0.31, 0.30), 0.35, SemanticClass.OTHER_OBJECT, gloss=0.04),
    Slot.SIGNAL: Material((0.03, 0.035, 0.03), 0.12, SemanticClass.POLE, gloss=0.03),
    Slot.CARGO: Material((0.55, 0.55, 0.54), 0.40, gloss=0.03),
}


def rgb(red: float, green: float, blue: float) -> Float32:
    """Return (3,) a linear colour."""
    return np.array([red, green, blue], np.float32)


def column(field: str) -> Float32:
    """Return one field of every slot's material as an array indexed by slot."""
    return np.array([getattr(MATERIALS[slot], field) for slot in Slot], np.float32)


def palette(changes: dict[Slot, tuple[float, float, float, float]] | None = None) -> Float32:
    """Return (slots, 4) colour and reflectance, the defaults but for what changes."""
    rows = np.concatenate([column("rgb"), column("reflectance")[:, None]], axis=1)
    for slot, row in (changes or {}).items():
        rows[slot] = row
    return rows


# Linear colour, reflectance face on, and how many cars in a hundred wear it.
_Paints = list[tuple[tuple[float, float, float, float], float]]
CAR_PAINTS: _Paints = [
    ((0.46, 0.47, 0.49, 0.46), 15),  # silver
    ((0.22, 0.225, 0.24, 0.36), 9),  # grey
    ((0.07, 0.074, 0.08, 0.24), 14),  # dark grey
    ((0.010, 0.010, 0.011, 0.09), 22),  # black
    ((0.72, 0.72, 0.70, 0.55), 14),  # white
    ((0.012, 0.024, 0.070, 0.20), 6),  # dark blue
    ((0.04, 0.10, 0.24, 0.30), 5),  # blue
    ((0.15, 0.21, 0.29, 0.32), 2),  # light blue
    ((0.26, 0.016, 0.014, 0.34), 5),  # red
    ((0.09, 0.010, 0.014, 0.22), 3),  # dark red
    ((0.015, 0.045, 0.028, 0.14), 2),  # green
    ((0.30, 0.26, 0.20, 0.36), 2),  # beige
    ((0.24, 0.10, 0.03, 0.34), 0.6),  # copper
    ((0.55, 0.36, 0.03, 0.45), 0.4),  # yellow
]
CARGO_PAINTS: _Paints = [
    ((0.72, 0.72, 0.71, 0.50), 50),  # white
    ((0.40, 0.40, 0.40, 0.40), 15),  # grey
    ((0.10, 0.11, 0.11, 0.20), 10),  # dark grey
    ((0.03, 0.07, 0.22, 0.25), 8),  # blue
    ((0.30, 0.02, 0.02, 0.38), 6),  # red
    ((0.03, 0.09, 0.05, 0.25), 5),  # green
    ((0.34, 0.28, 0.18, 0.38), 4),  # beige
    ((0.60, 0.38, 0.03, 0.45), 2),  # yellow
]


def random_paint(
    rng: np.random.Generator, paints: _Paints = CAR_PAINTS
) -> tuple[float, float, float, float]:
    """Draw a colour and reflectance, those of a car as common as on a German street."""
    weights = np.array([weight for _, weight in paints])
    row = np.array(paints[rng.choice(len(paints), p=weights / weights.sum())][0])
    row *= rng.uniform(0.85, 1.15) * rng.uniform(0.97, 1.03, 4)
    red, green, blue, reflectance = np.clip(row, 0.005, 0.9).tolist()
    return red, green, blue, reflectance


# Linear colours of clothes, common ones first.
_CLOTHES = np.array(
    [
        (0.02, 0.02, 0.025), (0.03, 0.04, 0.09), (0.10, 0.10, 0.11), (0.30, 0.30, 0.31),
        (0.62, 0.61, 0.58), (0.08, 0.13, 0.28), (0.33, 0.04, 0.04), (0.28, 0.21, 0.13),
        (0.07, 0.10, 0.05), (0.25, 0.36, 0.50), (0.50, 0.33, 0.05), (0.36, 0.10, 0.20),
    ]
)  # fmt: skip


def random_clothes(rng: np.random.Generator) -> Float32:
    """Draw the palette of a person, with or without a bicycle."""
    shirt = _CLOTHES[rng.integers(len(_CLOTHES))] * rng.uniform(0.7, 1.3, 3)
    trousers = _CLOTHES[rng.choice([0, 1, 1, 2, 3, 5, 7])] * rng.uniform(0.7, 1.2, 3)
    skin = np.array([0.55, 0.36, 0.27]) * rng.uniform(0.35, 1.15)
    frame = _CLOTHES[rng.integers(len(_CLOTHES))] * rng.uniform(0.6, 1.4, 3)
    hair = np.array([0.10, 0.06, 0.03]) * rng.uniform(0.2, 2.5)
    colours = {
        Slot.SHIRT: (*shirt, rng.uniform(0.2, 0.75)),
        Slot.TROUSERS: (*trousers, rng.uniform(0.15, 0.6)),
        Slot.SKIN: (*skin, 0.45),
        Slot.HAIR: (*hair, 0.15),
        Slot.BICYCLE: (*frame, 0.25),
    }
    return palette(colours)
