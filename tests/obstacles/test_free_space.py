"""What the scans of the horizon have seen at a place, beam by beam."""

import numpy as np
import pytest

from perception.obstacles.free_space import FreeSpaceMemory
from perception.sensor import HDL_64E

PLACE = np.array([[10.0, 0.0, 0.0]], np.float32)


def sphere(range_m):
    """Returns at one range ahead, in every direction of the sensor within 0.2 rad."""
    azimuth = np.arange(-0.2, 0.2, HDL_64E.azimuth_step_rad)
    elevation, azimuth = np.meshgrid(HDL_64E.elevations_rad, azimuth, indexing="ij")
    ray = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth)]
    return (np.stack([*ray, np.sin(elevation)], axis=-1).reshape(-1, 3) * range_m).astype(
        np.float32
    )


def past_returns(scans, moving=()):
    """Return how often the place was left, and how often visible, in scans from the oldest to the newest.

    F: beams pass to 20 m; H: they end at the place; B: they end at 5 m, before it.
    """
    memory = FreeSpaceMemory(HDL_64E, horizon_s=1.5)
    for number, letter in enumerate(scans):
        points = sphere({"F": 20.0, "H": 10.0, "B": 5.0}[letter])
        memory.push(points, np.eye(4), 0.1 * number)
        if number in moving:
            memory.mark_moving(points)
    past = memory.query(PLACE).past_returns(np.array([0]))
    return past.left[0], past.visible[0]


@pytest.mark.parametrize(
    ("scans", "left", "visible"),
    [("FFFFH", 0, 4), ("FFHHH", 0, 4), ("HFFFH", 1, 4), ("HFHFH", 2, 4), ("HBBBH", 0, 1)],
    ids=["comes", "stays", "was there", "comes and goes", "was hidden"],
)
def test_a_place_is_left_where_a_beam_passes_after_a_return(scans, left, visible):
    assert past_returns(scans) == (left, visible)


def test_what_moved_through_a_place_has_not_left_it():
    assert past_returns("HFFFH", moving=[0]) == (0, 3)


def test_scans_are_as_old_as_their_stamps_say():
    memory = FreeSpaceMemory(HDL_64E, horizon_s=1.5)
    for stamp_s in (0.0, 0.5, 1.0, 1.5, 2.0):
        memory.push(sphere(20.0), np.eye(4), stamp_s)
    assert memory.query(PLACE).ages_s.tolist() == [0.5, 1.0, 1.5]
    memory.push(sphere(20.0), np.eye(4), 6.0)
    assert memory.query(PLACE).ages_s.tolist() == [4.0]
