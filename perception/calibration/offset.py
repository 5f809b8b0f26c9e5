"""A change of the calibration: how it is written, and what is known of it.

An offset is a (6,) change: a rotation vector in rad and a translation in metres, both along the axes of the camera (x
right, y down, z ahead):

    cam_SE3_velo = from_motion_vector(offset) @ cam_SE3_velo of the frame
"""

from dataclasses import dataclass

import numpy as np

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
