"""Random positions along a road, and parking lots beside it."""

from dataclasses import dataclass

import numpy as np

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
