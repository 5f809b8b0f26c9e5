"""Paths along the road, and the poses that follow from them."""

from dataclasses import dataclass

import numpy as np

from data.synthetic.road import Road
from perception.types import Float64


@dataclass(frozen=True)
class Path:
    """A path along the road, sampled in time.

    Attributes:
        times_s: (K,) times in equal steps.
        s_m: (K,) positions along the centreline in metres.
        l_m: (K,) positions to the left of the centreline in metres.
        facing: Direction of a standing actor: 1 along the road, -1 against it.
    """

    times_s: Float64
    s_m: Float64
    l_m: Float64
    facing: int = 1

    def at(self, times_s: Float64 | float) -> tuple[Float64, Float64]:
        """Return s and l at some times."""
        return (
            np.asarray(np.interp(times_s, self.times_s, self.s_m)),
            np.asarray(np.interp(times_s, self.times_s, self.l_m)),
        )

    def speed_m_s(self, times_s: Float64) -> Float64:
        """Return the speed over the ground, without a sign."""
        (s0, l0), (s1, l1) = self.at(times_s - 0.05), self.at(times_s + 0.05)
        return np.asarray(np.hypot(s1 - s0, l1 - l0) / 0.1)

    def travelled_m(self, time_s: float) -> float:
        """Return the distance travelled since the first sample."""
        distance_m = np.concatenate(
            [[0.0], np.cumsum(np.hypot(np.diff(self.s_m), np.diff(self.l_m)))]
        )
        return float(np.interp(time_s, self.times_s, distance_m))


def vehicle_poses(road: Road, path: Path, times_s: Float64) -> Float64:
    """Return (K, 4, 4) world_SE3_vehicle: wheels on the road, so pitched and rolled with it."""
    s, side = path.at(times_s)
    forward = road.place(s + path.facing * 1.3, side) - road.place(s - path.facing * 1.3, side)
    left = road.place(s, side + path.facing * 0.7) - road.place(s, side - path.facing * 0.7)
    return _frames(forward, left, road.place(s, side))


def upright_poses(road: Road, path: Path, times_s: Float64) -> Float64:
    """Return (K, 4, 4) world_SE3_body of actors that stay upright and face along their path, as people do."""
    s, side = path.at(times_s)
    (s0, l0), (s1, l1) = path.at(times_s - 0.05), path.at(times_s + 0.05)
    is_static = np.hypot(s1 - s0, l1 - l0) < 1e-3
    turn = np.where(is_static, np.arctan2(0.0, path.facing), np.arctan2(l1 - l0, s1 - s0))
    heading = road.heading_rad(s) + turn
    zero = np.zeros_like(heading)
    forward = np.stack([np.cos(heading), np.sin(heading), zero], axis=-1)
    left = np.stack([-np.sin(heading), np.cos(heading), zero], axis=-1)
    return _frames(forward, left, road.place(s, side))


def _frames(forward: Float64, left: Float64, origin_m: Float64) -> Float64:
    """Stack right-handed unit frames; left is made square to forward."""
    x = forward / np.linalg.norm(forward, axis=-1, keepdims=True)
    z = np.cross(x, left)
    z /= np.linalg.norm(z, axis=-1, keepdims=True)
    poses = np.zeros((*x.shape[:-1], 4, 4))
    poses[..., :3, 0], poses[..., :3, 1], poses[..., :3, 2] = x, np.cross(z, x), z
    poses[..., :3, 3], poses[..., 3, 3] = origin_m, 1.0
    return poses
