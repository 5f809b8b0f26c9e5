"""Dimensions of cars and vans, and their random variation."""

from dataclasses import dataclass
from enum import Enum

import numpy as np


class BodyStyle(Enum):
    """Body style of a vehicle."""

    HATCHBACK = "hatchback"
    SALOON = "saloon"
    ESTATE = "estate"
    SUV = "suv"
    MINIVAN = "minivan"
    PANEL_VAN = "panel van"
    CITY_CAR = "city car"
    COUPE = "coupé"
    LIMOUSINE = "limousine"
    COMPACT_MPV = "compact MPV"
    OFF_ROADER = "off-roader"
    PICK_UP = "pick-up"
    SMALL_VAN = "small van"
    HIGH_VAN = "high van"

    @property
    def is_van(self) -> bool:
        """Whether it is labelled a van and not a car."""
        return self in _VANS


_VANS = (BodyStyle.MINIVAN, BodyStyle.PANEL_VAN, BodyStyle.SMALL_VAN, BodyStyle.HIGH_VAN)


@dataclass(frozen=True)
class VehicleDesign:
    r"""Measures of one vehicle in metres; `_ahead` counts back from the nose, `_back` from the tail.

                   roof_back  roof_ahead
                        ____________
    screen_back     ___/    cabin   \___     screen_ahead
              tail /                    \____ bonnet
                  |    _               _     \  nose
                  |___/ \_____________/ \____|
                  rear wheel        front wheel

    Attributes:
        style: Body style.
        length_m: Length from bumper to bumper.
        width_m: Width without mirrors.
        height_m: Height of the roof above the road.
        belt_m: Height of the window sills.
        bonnet_m: Height of the bonnet at the windscreen.
        nose_m: Height of the bonnet's front edge.
        tail_m: Height of the boot lid, or of the rear window's lower edge.
        screen_ahead_m: Foot of the windscreen.
        roof_ahead_m: Front edge of the roof.
        roof_back_m: Rear edge of the roof.
        screen_back_m: Foot of the rear window.
        roof_width: Width of the roof as a share of the width.
        wheel_m: Wheel radius.
        clearance_m: Height of the sill above the road.
        has_rear_windows: Whether there are windows behind the front doors.
        has_dark_bumpers: Whether the bumpers are of bare plastic.
    """

    style: BodyStyle
    length_m: float
    width_m: float
    height_m: float
    belt_m: float
    bonnet_m: float
    nose_m: float
    tail_m: float
    screen_ahead_m: float
    roof_ahead_m: float
    roof_back_m: float
    screen_back_m: float
    roof_width: float = 0.74
    wheel_m: float = 0.31
    clearance_m: float = 0.20
    has_rear_windows: bool = True
    has_dark_bumpers: bool = False

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Length, width, height."""
        return self.length_m, self.width_m, self.height_m

    @property
    def is_tall(self) -> bool:
        """Whether its sides are nearly upright."""
        return self.style.is_van or self.style is BodyStyle.OFF_ROADER

    @property
    def has_rear_seats(self) -> bool:
        """Whether its roof is long enough for a second row."""
        return self.style not in (BodyStyle.COUPE, BodyStyle.PICK_UP)

    @property
    def axles_m(self) -> tuple[float, float]:
        """Positions of the front and the rear axle along x."""
        return (
            self.length_m / 2 - 0.19 * self.length_m - 0.02,
            -self.length_m / 2 + 0.17 * self.length_m + 0.02,
        )


# length width height belt bonnet nose tail | screen_ahead roof_ahead roof_back screen_back
_TYPICAL_M = {
    BodyStyle.HATCHBACK: (3.95, 1.70, 1.47, 0.93, 0.96, 0.79, 0.96, 0.94, 1.62, 0.62, 0.16),
    BodyStyle.SALOON: (4.55, 1.78, 1.44, 0.92, 0.95, 0.77, 0.99, 1.20, 1.95, 1.45, 0.72),
    BodyStyle.ESTATE: (4.55, 1.77, 1.48, 0.92, 0.95, 0.77, 0.97, 1.18, 1.92, 0.52, 0.14),
    BodyStyle.SUV: (4.45, 1.83, 1.70, 1.06, 1.09, 0.95, 1.10, 1.12, 1.72, 0.50, 0.16),
    BodyStyle.MINIVAN: (4.55, 1.82, 1.85, 1.02, 1.08, 0.90, 1.08, 0.82, 1.70, 0.28, 0.10),
    BodyStyle.PANEL_VAN: (5.20, 1.95, 2.10, 1.15, 1.22, 1.02, 1.15, 0.72, 1.55, 0.10, 0.05),
    BodyStyle.CITY_CAR: (3.45, 1.62, 1.49, 0.93, 0.97, 0.82, 0.98, 0.74, 1.36, 0.42, 0.12),
    BodyStyle.COUPE: (4.25, 1.79, 1.34, 0.87, 0.89, 0.71, 0.92, 1.35, 2.05, 1.35, 0.55),
    BodyStyle.LIMOUSINE: (4.95, 1.87, 1.47, 0.95, 0.98, 0.80, 1.02, 1.30, 2.10, 1.55, 0.75),
    BodyStyle.COMPACT_MPV: (4.35, 1.79, 1.64, 0.97, 1.02, 0.86, 1.02, 0.90, 1.68, 0.40, 0.12),
    BodyStyle.OFF_ROADER: (4.50, 1.85, 1.86, 1.12, 1.15, 1.08, 1.12, 1.20, 1.52, 0.14, 0.08),
    BodyStyle.PICK_UP: (5.05, 1.83, 1.77, 1.06, 1.10, 1.00, 1.06, 1.20, 1.85, 2.25, 2.10),
    BodyStyle.SMALL_VAN: (4.35, 1.81, 1.86, 1.06, 1.12, 0.98, 1.06, 0.66, 1.36, 0.12, 0.06),
    BodyStyle.HIGH_VAN: (6.00, 2.00, 2.58, 1.22, 1.30, 1.10, 1.22, 0.60, 1.50, 0.10, 0.05),
}
_IS_HEIGHT = np.array([0, 0, 1, 1, 1, 1, 1, 0, 0, 0, 0], bool)
_HIGH_WHEELS = (BodyStyle.SUV, BodyStyle.OFF_ROADER, BodyStyle.PICK_UP, BodyStyle.HIGH_VAN)


def draw_design(style: BodyStyle, rng: np.random.Generator, size: float = 1.0) -> VehicleDesign:
    """Draw a vehicle of one style, its measures a few per cent around the typical ones.

    Args:
        style: Body style.
        rng: Random generator of its measures.
        size: Scale of its ground plan relative to new vehicles; older ones are smaller, though as tall.
    """
    spread = np.array([0.06, 0.03, 0.03, *[0.02] * 4, *[0.1] * 4])
    length, width, height, belt, bonnet, nose, tail, *back = (
        np.array(_TYPICAL_M[style])
        * (1 + spread * rng.uniform(-1, 1, len(spread)))
        * np.where(_IS_HEIGHT, 1.0, size)
    ).tolist()
    is_high = style in _HIGH_WHEELS
    is_tall = style.is_van or style is BodyStyle.OFF_ROADER
    return VehicleDesign(
        style,
        length_m=length,
        width_m=width,
        height_m=height,
        belt_m=belt,
        bonnet_m=bonnet,
        nose_m=nose,
        tail_m=tail,
        screen_ahead_m=back[0],
        roof_ahead_m=back[1],
        roof_back_m=back[2],
        screen_back_m=back[3],
        roof_width=0.86 if is_tall else rng.uniform(0.70, 0.78),
        wheel_m=rng.uniform(0.34, 0.37) if is_high else rng.uniform(0.29, 0.33),
        clearance_m=0.26 if is_high else 0.19,
        has_rear_windows=style not in (BodyStyle.PANEL_VAN, BodyStyle.HIGH_VAN),
        has_dark_bumpers=bool(rng.random() < 0.35),
    )
