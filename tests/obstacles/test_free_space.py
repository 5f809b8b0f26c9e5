"""What the scans of the horizon have seen at a place."""

import numpy as np
import pytest

from perception.obstacles.free_space import FreeSpaceMemory
from perception.sensor import HDL_64E
from tests.rays import unit_rays

PLACE = np.array([[10.0, 0.0, 0.0]], np.float32)


def sphere(range_m):
    """Returns at one range ahead, in every direction of the sensor within 0.2 rad."""
    azimuth = np.arange(-0.2, 0.2, HDL_64E.azimuth_step_rad)
    return (unit_rays(azimuth, HDL_64E.elevations_rad) * range_m).astype(np.float32)


@pytest.mark.parametrize(
    ("scans", "states"),
    [("FFFF", "FFF"), ("HFFF", "--H"), ("FHFF", "-HF"), ("FBBF", "LLF"), ("FBBB", "OOF")],
)
def test_younger_scans_are_asked_of_what_no_older_one_has_hit(scans, states):
    """From the oldest scan on F: beams pass to 20 m; H: they end at the place; B: they end at 5 m, before it."""
    memory = FreeSpaceMemory(HDL_64E, horizon_s=1.5)
    for number, letter in enumerate(scans):
        memory.push(sphere({"F": 20.0, "H": 10.0, "B": 5.0}[letter]), np.eye(4), 0.1 * number)
    letters = ["-FHOL"[state] for state in memory.query(PLACE).states[:, 0]]
    assert letters == list(states)


def test_scans_are_as_old_as_their_stamps_say():
    memory = FreeSpaceMemory(HDL_64E, horizon_s=1.5)
    for stamp_s in (0.0, 0.5, 1.0, 1.5, 2.0):
        memory.push(sphere(20.0), np.eye(4), stamp_s)
    assert memory.query(PLACE).ages_s.tolist() == [0.5, 1.0, 1.5]
    memory.push(sphere(20.0), np.eye(4), 6.0)
    assert memory.query(PLACE).ages_s.tolist() == [4.0]
