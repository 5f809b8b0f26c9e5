"""Where a followed point is heading: the way that it went since the last scan (5.3.4)."""

from dataclasses import dataclass

import numpy as np

from perception.types import Float64


@dataclass(frozen=True)
class HeadingFreezeConfig:
    """When a change of heading is taken for noise; values of the author's code.

    Attributes:
        slow_m_s: what is slower moves less in one scan than its points do.
        max_turn_rad: a slow object that turns more keeps its heading.
    """

    slow_m_s: float
    max_turn_rad: float


_WALKERS_AND_CYCLISTS = HeadingFreezeConfig(slow_m_s=0.5, max_turn_rad=0.4)
_VEHICLES = HeadingFreezeConfig(slow_m_s=4.0, max_turn_rad=0.15)
_VEHICLE_VOLUME_M3 = 4.0


def heading_freeze_config_for(size_m: Float64) -> HeadingFreezeConfig:
    """Return the rules for an object of (3,) a size; the author's classes are volumes."""
    return _WALKERS_AND_CYCLISTS if size_m.prod() <= _VEHICLE_VOLUME_M3 else _VEHICLES


def heading_from_course(
    displacement_m: Float64, elapsed_s: float, last_yaw_rad: float, config: HeadingFreezeConfig
) -> float:
    """Return the direction of (2+,) a way, or the last heading where the way is too short to tell."""
    length_m = float(np.hypot(displacement_m[0], displacement_m[1]))
    if length_m == 0 or elapsed_s <= 0:
        return last_yaw_rad
    yaw_rad = float(np.arctan2(displacement_m[1], displacement_m[0]))
    turn_rad = abs(np.angle(np.exp(1j * (yaw_rad - last_yaw_rad))))
    is_slow = length_m < config.slow_m_s * elapsed_s
    return last_yaw_rad if is_slow and turn_rad > config.max_turn_rad else yaw_rad
