"""Points of a sweep moved to one time: a spinning LiDAR measures while its vehicle drives.

velo_SE3_moved(t)    pose of the LiDAR t seconds after the stamp, in its frame at the stamp
point at the stamp = velo_SE3_moved(t of the point) * point as measured
"""

from dataclasses import dataclass

import numpy as np

from perception.geometry.se3 import cross_matrix, rotation_vector
from perception.kernels.deskewing import move_by_time
from perception.types import Float32, Float64, require_shape

# Poses are blended linearly between as many even times: at 2 rad/s within 0.1 s, 50 m away, 0.1 mm off the arc.
_STEPS = 64
_SMALL_RAD = 1e-6
_MIN_STEP_S = 1e-9


@dataclass(frozen=True)
class SweepMotion:
    """Motion of a LiDAR around the stamp of a scan.

    Attributes:
        span_s: First and last time of the motion in seconds from the stamp.
        velo_SE3_moved: (K, 4, 4) pose of the LiDAR in its frame at the stamp, at K even times of the span, K at least 2.
    """

    span_s: tuple[float, float]
    velo_SE3_moved: Float64

    def __post_init__(self) -> None:
        """Validate the shape of the poses."""
        require_shape("sweep motion velo_SE3_moved", self.velo_SE3_moved, ("K", 4, 4))

    @classmethod
    def steady(
        cls, velo_SE3_later: Float64, later_s: float, span_s: tuple[float, float]
    ) -> "SweepMotion":
        """Return the motion at constant velocity and turn rate.

        Args:
            velo_SE3_later: (4, 4) pose of the LiDAR at another time in its frame at the stamp.
            later_s: That time in seconds from the stamp, negative before it.
            span_s: First and last time of the motion in seconds from the stamp.
        """
        times_s = np.linspace(*span_s, _STEPS + 1)
        turn, along = _twist(velo_SE3_later)
        return cls(span_s, _moved(turn, along, times_s / later_s))


def deskew(points_velo: Float32, point_times_s: Float32, motion: SweepMotion) -> Float32:
    """Move every point of a sweep to the LiDAR's frame at the stamp; points without a return stay.

    Args:
        points_velo: (N, 4) points as measured, each in the LiDAR's frame at its own time.
        point_times_s: (N,) seconds from the stamp.
        motion: Motion of the LiDAR; points before its first and after its last time move as those at these times.
    """
    require_shape("point_times_s", point_times_s, (len(points_velo),))
    first_s, last_s = motion.span_s
    return move_by_time(
        np.ascontiguousarray(points_velo, np.float32),
        np.ascontiguousarray(point_times_s, np.float32),
        np.ascontiguousarray(motion.velo_SE3_moved, np.float64),
        first_s,
        max(last_s - first_s, _MIN_STEP_S) / (len(motion.velo_SE3_moved) - 1),
    )


def _twist(pose: Float64) -> tuple[Float64, Float64]:
    """Return rotation vector and translation whose constant motion reaches a pose: the logarithm in SE(3)."""
    turn = rotation_vector(pose[:3, :3])
    return turn, np.asarray(np.linalg.solve(_arcs(turn, np.ones(1))[0], pose[:3, 3]), np.float64)


def _moved(turn: Float64, along: Float64, shares: Float64) -> Float64:
    """Return the (K, 4, 4) poses that (K,) shares of a constant motion reach: the exponential in SE(3)."""
    arcs, of_path = _arcs(turn, shares), shares[:, None, None]
    poses = np.tile(np.eye(4), (len(shares), 1, 1))
    # A rotation is what its mean on the way has turned: exp(w) = I + w mean.
    poses[:, :3, :3] += of_path * (cross_matrix(turn) @ arcs)
    poses[:, :3, 3] = shares[:, None] * (arcs @ along)
    return poses


def _arcs(turn: Float64, shares: Float64) -> Float64:
    """Return the (K, 3, 3) mean of the rotations on the way to each of (K,) shares of a rotation vector."""
    cross = cross_matrix(turn)
    angles_rad = np.abs(shares) * np.linalg.norm(turn)
    # np.sinc(t) is sin(pi t) / (pi t), and 1 at 0.
    first = 0.5 * np.sinc(angles_rad / (2 * np.pi)) ** 2
    is_large = angles_rad > _SMALL_RAD
    safe_rad = np.where(is_large, angles_rad, 1.0)
    second = np.where(is_large, (safe_rad - np.sin(safe_rad)) / safe_rad**3, 1 / 6)
    cross_parts = (shares * first)[:, None, None] * cross
    return np.asarray(np.eye(3) + cross_parts + (shares**2 * second)[:, None, None] * cross @ cross)
