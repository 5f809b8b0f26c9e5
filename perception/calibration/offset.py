"""A change of the calibration: how it is written, and what is known of it.

An offset is a (6,) change: a rotation vector in rad and a translation in metres, both along the axes of the camera (x
right, y down, z ahead):

    cam_SE3_velo = offset_SE3(offset) @ cam_SE3_velo of the frame
"""

from dataclasses import dataclass

import numpy as np

from perception.geometry.se3 import from_rotation_translation, from_rotation_vector, rotation_vector
from perception.types import Float64

# Deviations of an offset of which nothing is known.
UNKNOWN = np.array([*np.radians([2.0] * 3), *[0.3] * 3])


@dataclass(frozen=True)
class OffsetEstimate:
    """How far the calibration is off.

    Attributes:
        offset: (6,) change of the calibration.
        deviations: (6,) its standard deviations: by how much estimates of true calibrations differ from none.
        is_determined: Whether the estimate counts.
    """

    offset: Float64
    deviations: Float64
    is_determined: bool = True


def offset_SE3(offset: Float64) -> Float64:
    """Return the (4, 4) transform of a (6,) offset."""
    return from_rotation_translation(from_rotation_vector(offset[:3]), offset[3:])


def offset_of(change_SE3_cam: Float64) -> Float64:
    """Return the (6,) offset of a (4, 4) transform."""
    return np.concatenate([rotation_vector(change_SE3_cam[:3, :3]), change_SE3_cam[:3, 3]])
