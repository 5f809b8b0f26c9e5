"""A GPS-aided INS: the true pose with an error that drifts and jitters, as packets on the globe.

Of the error's variance nine tenths belong to a first-order Gauss-Markov process that forgets in five
seconds, as a filtered GPS position does, and one tenth is independent from frame to frame.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from data.kitti.oxts import InsPacket, Mercator
from perception.errors import UsageError
from perception.geometry import se3
from perception.types import Float64

ORIGIN = Mercator(latitude_deg=49.0, longitude_deg=8.4, altitude_m=115.0)
_GRAVITY_M_S2 = 9.81
_MEMORY_S = 5.0
_DRIFTING_SHARE = 0.9


@dataclass(frozen=True)
class InsNoise:
    """Standard deviations of an INS; the defaults are those that KITTI's maker states.

    Attributes:
        position_m: Standard deviation of the position along each axis in metres.
        angle_deg: Standard deviation of the angle about each axis in degrees.
    """

    position_m: float = 0.02
    angle_deg: float = 0.1

    def __post_init__(self) -> None:
        """Validate that the deviations are not negative."""
        if self.position_m < 0 or self.angle_deg < 0:
            raise UsageError("INS noise", expected="deviations of 0 or more", found=str(vars(self)))


def errors(frames: int, step_s: float, sigma: float, rng: np.random.Generator) -> Float64:
    """Draw (frames, 3) errors of one standard deviation along three axes."""
    kept = np.exp(-step_s / _MEMORY_S)
    drift = np.empty((frames, 3))
    drift[0] = rng.normal(size=3)
    for frame in range(1, frames):
        drift[frame] = kept * drift[frame - 1] + np.sqrt(1 - kept**2) * rng.normal(size=3)
    jitter = rng.normal(size=(frames, 3))
    mixed = np.sqrt(_DRIFTING_SHARE) * drift + np.sqrt(1 - _DRIFTING_SHARE) * jitter
    return np.asarray(sigma * mixed)


def packets(
    world_SE3_imu: Float64, rate_hz: float, noise: InsNoise, rng: np.random.Generator
) -> list[InsPacket]:
    """Measure (F, 4, 4) true poses.

    Args:
        world_SE3_imu: (F, 4, 4) true poses, x of the world to the east and y to the north.
        rate_hz: Packets per second.
        noise: Noise of the INS.
        rng: Random generator of the errors.
    """
    frames = len(world_SE3_imu)
    shift_m = errors(frames, 1 / rate_hz, noise.position_m, rng)
    turn_rad = errors(frames, 1 / rate_hz, np.radians(noise.angle_deg), rng)
    angles = Rotation.from_matrix(world_SE3_imu[:, :3, :3]).as_euler("ZYX")[:, ::-1] + turn_rad
    velocity = _slope(world_SE3_imu[:, :3, 3], rate_hz)
    acceleration = _slope(velocity, rate_hz)
    acceleration[:, 2] += _GRAVITY_M_S2
    turning = _slope(np.unwrap(angles - turn_rad, axis=0), rate_hz)
    found = []
    for row, pose in enumerate(world_SE3_imu):
        roll, pitch, yaw = angles[row]
        noisy = se3.from_euler(roll, pitch, yaw, pose[:3, 3] + shift_m[row])
        found.append(
            ORIGIN.packet(noisy, velocity[row], noisy[:3, :3].T @ acceleration[row], turning[row])
        )
    return found


def _slope(values: Float64, rate_hz: float) -> Float64:
    """Return time derivatives, zero where there is one sample only."""
    if len(values) < 2:
        return np.zeros_like(values)
    return np.asarray(np.gradient(values, 1 / rate_hz, axis=0))
