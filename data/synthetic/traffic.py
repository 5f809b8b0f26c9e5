"""Vehicles that follow each other without touching: the Intelligent Driver Model, lane by lane.

Treiber, Hennecke, Helbing: Congested traffic states in empirical observations and microscopic
simulations, Physical Review E 62, 2000.
"""

from dataclasses import dataclass

import numpy as np

from perception.types import Float64

STEP_S = 0.05
WARM_UP_S = 4.0

_ACCELERATION_M_S2 = 1.7
_BRAKING_M_S2 = 2.2
_HEADWAY_S = 1.1
_STANDSTILL_M = 2.6
_HARDEST_M_S2 = 6.0


@dataclass(frozen=True)
class Block:
    """A closure of the lane for some time, as by a crossing pedestrian.

    Attributes:
        place_m: Position where vehicles stop, along the lane's direction, in metres.
        from_s: Start of the closure in seconds.
        until_s: End of the closure in seconds.
    """

    place_m: float
    from_s: float
    until_s: float


@dataclass(frozen=True)
class Slowdown:
    """A temporary reduction of a vehicle's desired speed.

    Attributes:
        vehicle: Row of the vehicle.
        from_s: Start in seconds.
        until_s: End in seconds.
        factor: Share of its desired speed; 0 stops it.
    """

    vehicle: int
    from_s: float
    until_s: float
    factor: float


@dataclass(frozen=True)
class Lane:
    """Vehicles of one lane, first in front; places run along the lane's own direction.

    Attributes:
        place_m: (V,) positions of the centres at the start of the warm-up, falling.
        length_m: (V,) lengths in metres.
        desired_m_s: (V,) desired speeds.
    """

    place_m: Float64
    length_m: Float64
    desired_m_s: Float64


def simulation_times(duration_s: float) -> Float64:
    """Return the steps of a simulation that ends a second after the drive."""
    return np.arange(-WARM_UP_S, duration_s + 1.0, STEP_S)


def simulate_lane(
    lane: Lane, times_s: Float64, blocks: list[Block], slowdowns: list[Slowdown]
) -> Float64:
    """Return (K, V) where each vehicle is at each time."""
    place, speed = lane.place_m.copy(), 0.95 * lane.desired_m_s
    half = lane.length_m / 2
    ignored = np.zeros((len(blocks), len(place)), bool)
    found = np.empty((len(times_s), len(place)))
    for step, time in enumerate(times_s):
        found[step] = place
        desired = _desired(lane, time, slowdowns)
        gap = np.full(len(place), 1e3)
        leader = np.zeros(len(place))
        gap[1:] = place[:-1] - half[:-1] - place[1:] - half[1:]
        leader[1:] = speed[:-1]
        for row, block in enumerate(blocks):
            if block.from_s <= time < block.until_s:
                to_block = block.place_m - place - half
                if time - block.from_s < STEP_S:
                    # A vehicle that can no longer stop comfortably drives through.
                    ignored[row] = to_block < speed**2 / (2 * 3.0)
                # A vehicle that arrives after the closure need not brake.
                in_time = to_block < speed * (block.until_s - time) + 3.0
                is_nearer = (to_block < gap) & ~ignored[row] & (to_block > -1.0) & in_time
                gap = np.where(is_nearer, to_block + 1.5, gap)
                leader = np.where(is_nearer, 0.0, leader)
        speed, place = _advance(speed, place, desired, gap, leader)
    return found


def _desired(lane: Lane, time_s: float, slowdowns: list[Slowdown]) -> Float64:
    desired = lane.desired_m_s.copy()
    for slow in slowdowns:
        if slow.from_s <= time_s < slow.until_s:
            desired[slow.vehicle] *= slow.factor
    return desired


def _advance(
    speed: Float64, place: Float64, desired: Float64, gap: Float64, leader: Float64
) -> tuple[Float64, Float64]:
    """Step the model: free road term minus interaction with the vehicle in front."""
    closing = speed * (speed - leader) / (2 * np.sqrt(_ACCELERATION_M_S2 * _BRAKING_M_S2))
    desired_gap_m = _STANDSTILL_M + np.maximum(0.0, _HEADWAY_S * speed + closing)
    free = np.where(
        desired > 0.1, 1 - (speed / np.maximum(desired, 0.1)) ** 4, -2.0 * np.sign(speed)
    )
    pull = _ACCELERATION_M_S2 * (free - (desired_gap_m / np.maximum(gap, 0.3)) ** 2)
    new_speed = np.maximum(0.0, speed + STEP_S * np.clip(pull, -_HARDEST_M_S2, 2.5))
    return new_speed, place + STEP_S * (speed + new_speed) / 2
