"""The road as a formula: a curved, sloping, banked centreline with a cross-section of lanes and kerbs.

A place is (s, l): metres along the centreline, and metres to its left.

    pavement   kerb  parking   lane (oncoming) | lane (ego)  parking  kerb   pavement
    l > 0  ____|~|_________________________________________________|~|____  l < 0
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from perception.types import Float64

_STEP_M = 0.5
# Waves of the land's bumps: radians a metre along the road and across it.
_BUMPS_1_M = [(0.31, 0.13), (-0.22, 0.57), (0.83, -0.41), (0.52, 1.17), (1.31, 0.71), (-1.53, 1.19)]


@dataclass(frozen=True)
class RoadShape:
    """Curves, slopes and cross-section of a road; phases are drawn with the world.

    Attributes:
        curvature_1_m: Greatest curvature in 1/m.
        curve_length_m: Distance from one left curve to the next in metres.
        slope: Greatest slope, rise over distance.
        slope_length_m: Distance from one crest to the next in metres.
        bank: Greatest lateral slope, left over right.
        crown: Fall of each lane towards its kerb.
        lane_m: Width of a lane.
        parking_m: Width of a parking lane, 0 for none.
        kerb_m: Height of the kerbs.
        pavement_m: Width of a pavement.
        lanes: Number of lanes in each direction.
        land_m: Heights of the land beside the road, right and left, in metres; negative for ditches.
        land_reach_m: Distance over which the land rises in metres.
        roughness_m: Standard deviation of the height of bumps of the land in metres.
    """

    curvature_1_m: float = 1 / 160
    curve_length_m: float = 190.0
    slope: float = 0.03
    slope_length_m: float = 150.0
    bank: float = 0.015
    crown: float = 0.02
    lane_m: float = 3.5
    parking_m: float = 2.1
    kerb_m: float = 0.12
    pavement_m: float = 2.8
    lanes: int = 1
    land_m: tuple[float, float] = (0.0, 0.0)
    land_reach_m: float = 6.0
    roughness_m: float = 0.0

    @property
    def lanes_m(self) -> float:
        """From the centreline to the edge of the outer lane."""
        return self.lanes * self.lane_m

    @property
    def half_width_m(self) -> float:
        """From the centreline to a kerb."""
        return self.lanes_m + self.parking_m

    @property
    def outer_m(self) -> float:
        """From the centreline to the outer edge of a pavement, where the land begins."""
        return self.half_width_m + self.pavement_m

    @property
    def is_uneven(self) -> bool:
        """Whether the land beside the road is more than a plane."""
        return self.roughness_m > 0 or any(self.land_m)


@dataclass(frozen=True)
class Road:
    """A road of one shape.

    Attributes:
        shape: Curves, slopes and cross-section.
        phases_rad: (3,) phases of curve, slope and bank.
        start_m: First position s in metres.
        end_m: Last position s in metres.
    """

    shape: RoadShape
    phases_rad: Float64 = field(default_factory=lambda: np.zeros(3))
    start_m: float = -200.0
    end_m: float = 400.0

    @cached_property
    def _stations(self) -> Float64:
        return np.arange(self.start_m, self.end_m + _STEP_M, _STEP_M)

    @cached_property
    def _heading_rad(self) -> Float64:
        turn = 2 * np.pi / self.shape.curve_length_m
        angle = turn * self._stations + self.phases_rad[0]
        heading = -self.shape.curvature_1_m / turn * np.cos(angle)
        return np.asarray(heading - np.interp(0.0, self._stations, heading))

    @cached_property
    def _centre_m(self) -> Float64:
        steps = _STEP_M * np.stack([np.cos(self._heading_rad), np.sin(self._heading_rad)], axis=1)
        path = np.cumsum(steps, axis=0) - steps / 2
        return np.asarray(path - [np.interp(0.0, self._stations, column) for column in path.T])

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self._centre_m)

    def heading_rad(self, s_m: Float64) -> Float64:
        """Return the centreline's direction, from +x towards +y."""
        return np.asarray(np.interp(s_m, self._stations, self._heading_rad))

    def profile_m(self, s_m: Float64) -> Float64:
        """Return the centreline's height."""
        wave = 2 * np.pi / self.shape.slope_length_m
        height = self.shape.slope / wave * np.sin(wave * s_m + self.phases_rad[1])
        return np.asarray(height - self.shape.slope / wave * np.sin(self.phases_rad[1]))

    def bank(self, s_m: Float64) -> Float64:
        """Return the lateral slope, rising to the left."""
        return np.asarray(self.shape.bank * np.sin(s_m / 35.0 + self.phases_rad[2]))

    def section_m(self, l_m: Float64) -> Float64:
        """Return the height of the cross-section over the centreline, without bank."""
        side, shape = np.abs(l_m), self.shape
        kerb = shape.half_width_m
        carriageway = -shape.crown * np.minimum(side, kerb)
        beside = np.where(side > kerb, shape.kerb_m + 0.015 * (side - kerb), 0.0)
        return np.asarray(carriageway + beside + self._land_m(l_m))

    def _land_m(self, l_m: Float64) -> Float64:
        """Return how far the land has risen, in a curve without edges."""
        shape = self.shape
        share = np.clip((np.abs(l_m) - shape.outer_m) / shape.land_reach_m, 0, 1)
        return np.where(l_m < 0, *shape.land_m) * share**2 * (3 - 2 * share)

    def bumps_m(self, s_m: Float64, l_m: Float64) -> Float64:
        """Return the bumps of the land: waves of 3 to 20 m in all directions, none on the road."""
        if self.shape.roughness_m == 0:
            return np.zeros(np.broadcast(s_m, l_m).shape)
        amplitude = self.shape.roughness_m * np.sqrt(2 / len(_BUMPS_1_M))
        waves = sum(
            np.sin(along * s_m + across * l_m + number * self.phases_rad.sum())
            for number, (along, across) in enumerate(_BUMPS_1_M, start=1)
        )
        share = np.clip((np.abs(l_m) - self.shape.outer_m) / 1.5, 0, 1)
        return np.asarray(amplitude * share * waves)

    def height_m(self, s_m: Float64, l_m: Float64) -> Float64:
        """Return the ground's height at (s, l)."""
        plane = self.profile_m(s_m) + self.bank(s_m) * l_m
        return plane + self.section_m(l_m) + self.bumps_m(s_m, l_m)

    def place(self, s_m: Float64, l_m: Float64) -> Float64:
        """Return (..., 3) the ground's points at (s, l)."""
        s, side = np.broadcast_arrays(np.asarray(s_m, float), np.asarray(l_m, float))
        heading = self.heading_rad(s)
        x = np.interp(s, self._stations, self._centre_m[:, 0]) - np.sin(heading) * side
        y = np.interp(s, self._stations, self._centre_m[:, 1]) + np.cos(heading) * side
        return np.stack([x, y, self.height_m(s, side)], axis=-1)

    def locate(self, xy_m: Float64) -> tuple[Float64, Float64]:
        """Return s and l of (N, 2) places of the world."""
        _, nearest = self._tree.query(xy_m[:, :2])
        s = self._stations[nearest]
        for _ in range(2):
            offset = xy_m[:, :2] - self.place(s, np.zeros_like(s))[:, :2]
            heading = self.heading_rad(s)
            s = s + np.cos(heading) * offset[:, 0] + np.sin(heading) * offset[:, 1]
        offset = xy_m[:, :2] - self.place(s, np.zeros_like(s))[:, :2]
        heading = self.heading_rad(s)
        return s, np.cos(heading) * offset[:, 1] - np.sin(heading) * offset[:, 0]
