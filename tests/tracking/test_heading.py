"""Headings by the outlines of clusters."""

import numpy as np
import pytest

from perception.geometry.footprints import Footprints, footprints_of
from perception.geometry.se3 import wrap
from perception.tracking.heading import yaws_of_shape


def outline(length_m: float, width_m: float, yaw_rad: float, sides: str) -> Footprints:
    """Return the footprint of some sides of a box: its rear, its right side, or all four."""
    along, across = np.linspace(0, length_m, 40), np.linspace(0, width_m, 20)
    parts = {
        "rear": np.column_stack([np.zeros(20), across]),
        "right": np.column_stack([along, np.zeros(40)]),
        "front": np.column_stack([np.full(20, length_m), across]),
        "left": np.column_stack([along, np.full(40, width_m)]),
    }
    xy_m = np.concatenate([parts[name] for name in sides.split()])
    xy_m += np.random.default_rng(0).normal(0, 0.01, xy_m.shape)
    turn = np.array([[np.cos(yaw_rad), np.sin(yaw_rad)], [-np.sin(yaw_rad), np.cos(yaw_rad)]])
    points_m = np.column_stack([xy_m @ turn, np.zeros(len(xy_m))])
    return footprints_of(points_m, np.zeros(len(points_m), np.int64), 1)


@pytest.mark.parametrize("sides", ["right", "rear right", "rear right front left"])
@pytest.mark.parametrize("yaw_deg", [0.0, 31.0, 77.0, 140.0])
@pytest.mark.parametrize(("length_m", "width_m"), [(4.0, 1.7), (2.0, 0.8), (12.0, 2.5)])
def test_the_heading_is_along_the_longer_side(length_m, width_m, yaw_deg, sides):
    footprint = outline(length_m, width_m, np.radians(yaw_deg), sides)
    off_rad = wrap(yaws_of_shape(footprint) - np.radians(yaw_deg), np.pi)
    assert np.degrees(np.abs(off_rad))[0] < 3.0


def test_no_outline_has_no_heading():
    assert yaws_of_shape(Footprints.empty()).shape == (0,)
