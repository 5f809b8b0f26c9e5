"""A tunnel over the road: walls beside the pavements, a vault, and little light but that of its ends."""

from dataclasses import dataclass

import numpy as np

from data.synthetic import meshes, street
from data.synthetic.materials import Slot, palette
from data.synthetic.road import Road
from data.synthetic.street import Part
from perception.types import Float32

_WALL_M, _VAULT_M = 3.6, 2.0  # height of the walls, and of the vault over them
_BEYOND_M = 0.3  # of the walls beyond the pavements
_LAMPS = 0.03  # light of the tunnel's lamps as a share of the sky's
_DAYLIGHT_M = 7.0  # depth into the tunnel at which a third of the daylight is left
_ARC_RAD = np.linspace(0, np.pi, 9)
_LAMP_EVERY_M, _LAMP_Z_M = 8.0, _WALL_M + _VAULT_M - 0.35
_LAMP = meshes.box((-0.8, -0.12, _LAMP_Z_M), (0.8, 0.12, _LAMP_Z_M + 0.1), Slot.HEADLIGHT)
# Lamps shine as paint does that is so much brighter than white, in their own faint light; and reflectance.
_LAMP_COLOUR = (200.0, 190.0, 160.0, 0.7)


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
