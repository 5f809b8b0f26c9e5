"""The local area and the vehicle's outline: their edges, alone and in a cropped scan."""

import numpy as np

from perception.geometry.grids import EgoVehicle, LocalArea

AREA = LocalArea(ahead_m=4.0, behind_m=2.0, side_m=1.0)
VEHICLE = EgoVehicle(front_m=4.0, rear_m=2.0, side_m=1.0)
# Within, on each of the four edges, and beyond each.
PLACES_M = np.array(
    [[0, 0], [4, 0], [-2, 0], [0, 1], [0, -1], [4.5, 0], [-2.5, 0], [0, 1.5], [0, -1.5]]
)


def test_an_edge_belongs_to_neither_area_nor_vehicle():
    is_within = [True] + [False] * 8
    assert AREA.contains_xy(PLACES_M).tolist() == is_within
    assert VEHICLE.contains_xy(PLACES_M).tolist() == is_within
    assert AREA.contains_xy(PLACES_M, margin_m=0.25).tolist() == [True] * 5 + [False] * 4
    assert AREA.contains_xy(PLACES_M, margin_m=0.5).tolist() == [True] * 5 + [False] * 4


def test_cropping_is_what_contains_says():
    points = np.column_stack([PLACES_M, np.zeros((9, 2))]).astype(np.float32)
    assert AREA.crop(points).rows.tolist() == [0]
    assert VEHICLE.crop(points).rows.tolist() == list(range(1, 9))
    np.testing.assert_array_equal(AREA.crop(points).points_velo, points[:1])
