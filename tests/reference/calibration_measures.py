"""Another measure of a calibration: mutual information of reflectance and grey values."""

from collections.abc import Sequence

import cv2
import numpy as np

from perception.geometry.camera import project
from perception.geometry.se3 import from_motion_vector
from perception.health.miscalibration import corrected
from perception.types import Float64, Frame

_BINS = 32
_NEAREST_M = 1.0


def mutual_information(frames: Sequence[Frame], offset: Float64) -> float:
    """Return the mutual information of reflectance and grey values of all returns in view (Pandey et al., 2012).

    Args:
        frames: Frames with images and calibrations.
        offset: (6,) change of the calibration.
    """
    joint = np.zeros((_BINS, _BINS))
    for frame in frames:
        turned = corrected(frame, from_motion_vector(offset))
        assert turned.image is not None
        assert turned.calibration is not None
        grey = cv2.cvtColor(turned.image, cv2.COLOR_RGB2GRAY)
        pixels, depths_m = project(turned.calibration.image_P_velo, turned.points_velo)
        with np.errstate(invalid="ignore"):
            inside = (pixels >= 0).all(axis=1) & (pixels < np.array(grey.shape[::-1]) - 1).all(
                axis=1
            )
        used = inside & (depths_m > _NEAREST_M)
        columns, rows = np.rint(pixels[used]).astype(int).T
        values = turned.points_velo[used, 3], grey[rows, columns] / 256
        joint += np.histogram2d(*values, bins=_BINS, range=((0, 1), (0, 1)))[0]
    shares = joint / max(joint.sum(), 1)
    apart = shares.sum(axis=1, keepdims=True) * shares.sum(axis=0, keepdims=True)
    known = shares > 0
    return float((shares[known] * np.log(shares[known] / apart[known])).sum())
