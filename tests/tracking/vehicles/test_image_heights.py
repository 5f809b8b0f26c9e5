"""Heights by the upper sides of boxes in the image."""

import numpy as np
import pytest

from perception.geometry.camera import box_outlines_px
from perception.tracking.vehicles.image_heights import image_heights_m
from tests.vehicle_scenes import CALIBRATION, cars


@pytest.mark.parametrize("height_m", [1.0, 1.5, 2.5])
@pytest.mark.parametrize("yaw_rad", [0.0, 0.7])
def test_a_box_has_the_height_of_its_outline_whatever_is_assumed(height_m, yaw_rad):
    P = CALIBRATION.image_P_velo
    boxes_px = box_outlines_px(P, cars((15.0, 3.0, yaw_rad), size_m=(4.0, 1.6, height_m)))
    assumed = cars((15.0, 3.0, yaw_rad), size_m=(4.0, 1.6, 1.7))
    np.testing.assert_allclose(image_heights_m(assumed, boxes_px, P), [height_m], atol=1e-9)
