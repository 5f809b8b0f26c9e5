"""Parked vehicles: in the parking lanes along a road, and in parking lots beside it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from data.synthetic import actors as actor_models
from data.synthetic.actors import Actor, Body
from data.synthetic.fleet import Fleet
from data.synthetic.motion import Path, vehicle_poses
from data.synthetic.road import Road
from data.synthetic.roadside import Plot
from data.synthetic.town import Clearing, IsFree, is_always_free
from perception.geometry import se3


@dataclass(frozen=True)
class Parking:
    """Parks vehicles of a fleet.

    Attributes:
        road: Road.
        fleet: Bodies of the world's traffic.
        taken: Share of the places that are taken.
        actors: Actors of the world, to which the parked ones are added.
        rng: Random generator of places and colours.
    """

    road: Road
    fleet: Fleet
    taken: float
    actors: list[Actor]
    rng: np.random.Generator

    def along_road(
        self,
        stretch_m: tuple[float, float],
        clearings: Sequence[Clearing],
        angle_rad: float = 0.0,
        is_free: IsFree = is_always_free,
    ) -> None:
        """Fill the parking lanes with vehicles at an angle, leaving gaps and the crossings clear.

        Args:
            stretch_m: Start and end of the stretch in metres.
            clearings: Stretches where no vehicle may stand.
            angle_rad: Angle of the vehicles to the road in radians.
            is_free: Function that tells whether a lane is free, by start, length and side.
        """
        shape, rng = self.road.shape, self.rng
        if shape.parking_m < 1.8:
            return
        for side in (-1, 1):
            s = stretch_m[0] + 4.0
            while s < stretch_m[1] - 8:
                body = self.fleet.parked()
                pitch_m, (along_m, depth_m) = _pitch_m(body, angle_rad), _extent_m(body, angle_rad)
                s += pitch_m / 2 + float(rng.uniform(0.7, 1.4))
                is_clear = all(abs(s - c.s_m) > c.half_m + 2 for c in clearings)
                is_clear &= is_free(s - along_m / 2 - 0.3, along_m + 0.6, side)
                if rng.random() < self.taken and is_clear and depth_m < shape.parking_m + 0.2:
                    # Slanted vehicles stand in the middle of their lane, others at the kerb.
                    room_m = shape.parking_m if angle_rad > 0 else 0.3 + depth_m
                    l_m = side * (shape.half_width_m - room_m / 2)
                    turn = float(rng.normal(0, 0.02)) + (np.pi if side > 0 else 0.0) - angle_rad
                    self._stand(body, s, l_m, turn)
                s += pitch_m / 2

    def off_road(self, parking_lots: Sequence[Plot]) -> None:
        """Park vehicles in parking lots, in one or two rows, all at about the same angle to the road."""
        for parking_lot in parking_lots:
            angle = float(self.rng.choice([0.5, 0.5, 0.5, 0.33, 0.25, 0.0])) * np.pi
            for row in range(int(self.rng.choice([1, 1, 2]))):
                out_m = self.road.shape.outer_m + 3.6 + 6.5 * row
                self._fill_row(parking_lot, out_m, angle)

    def _fill_row(self, parking_lot: Plot, out_m: float, angle_rad: float) -> None:
        s = parking_lot.s_m + 1.0
        while s < parking_lot.s_m + parking_lot.length_m - 2.0:
            body = self.fleet.off_road()
            # Long vehicles park along the road, so that they do not reach into it.
            angle = 0.0 if body.kind not in ("Car", "Van") else angle_rad
            along_m, _ = _extent_m(body, angle)
            if s + along_m > parking_lot.s_m + parking_lot.length_m:
                break
            s += along_m / 2 + 0.4
            if self.rng.random() < self.taken:
                turn = angle + float(self.rng.normal(0, 0.06)) + np.pi * float(self.rng.integers(2))
                self._stand(
                    body, s, parking_lot.side * (out_m + float(self.rng.normal(0, 0.2))), turn
                )
            s += along_m / 2 + 0.4

    def _stand(self, body: Body, s_m: float, l_m: float, turn_rad: float) -> None:
        """Park a vehicle at any angle to the road, level with the ground under it."""
        path = Path(np.zeros(1), np.array([s_m]), np.array([l_m]))
        level = vehicle_poses(self.road, path, np.zeros(1))[0]
        appearance = actor_models.draw_appearance(body, self.rng)
        pose = level @ se3.from_euler(0, 0, turn_rad)
        self.actors.append(Actor(len(self.actors), body, appearance, None, pose))


def _extent_m(body: Body, angle_rad: float) -> tuple[float, float]:
    """Return how far a vehicle that stands at an angle to the road reaches along and across it."""
    length, width, _ = body.size_m
    along, across = abs(np.cos(angle_rad)), abs(np.sin(angle_rad))
    return float(along * length + across * width), float(across * length + along * width)


def _pitch_m(body: Body, angle_rad: float) -> float:
    """Return how much of a row a vehicle takes between others that stand at the same angle."""
    length, width, _ = body.size_m
    along, across = abs(np.cos(angle_rad)), abs(np.sin(angle_rad))
    return float(min(length / max(along, 1e-6), width / max(across, 1e-6)))
