"""Tracks on the ground: what is evaluated, ignored, and wrong, by hand-made boxes."""

import numpy as np
import pytest

from perception.evaluation.multi_object.ground_protocol import (
    GroundTracks,
    ground_frame,
    measured_objects,
    tracks_around,
)
from perception.types import Boxes3D, Labels

_IN_IMAGE_PX = np.array([100.0, 100, 200, 160])


def boxes(*x_m: float) -> Boxes3D:
    """Return cars ahead at these distances."""
    bottom_m = np.array([[x, 0.0, -1.7] for x in x_m]).reshape(-1, 3)
    return Boxes3D(bottom_m, np.tile([4.0, 2.0, 1.5], (len(x_m), 1)), np.zeros(len(x_m)))


def labels(
    *x_m: float, types: tuple[str, ...] = (), occlusion: int = 0, region_px: tuple[int, ...] = ()
) -> Labels:
    count = len(x_m)
    return Labels(
        boxes(*x_m),
        np.tile(_IN_IMAGE_PX, (count, 1)),
        np.array(types or ("Car",) * count),
        np.arange(count),
        np.zeros(count),
        np.full(count, occlusion),
        np.array(region_px, float).reshape(-1, 4),
    )


def tracks(*x_m: float, kind: str = "Car") -> GroundTracks:
    count = len(x_m)
    in_image = np.tile(_IN_IMAGE_PX, (count, 1))
    return GroundTracks(10 + np.arange(count), np.full(count, kind), boxes(*x_m), in_image)


def test_the_overlap_is_that_from_above():
    frame = ground_frame(labels(20.0, 40.0), tracks(21.0, 60.0), "Car")
    assert frame.truth_ids.tolist() == [0, 1]
    assert frame.track_ids.tolist() == [10, 11]
    np.testing.assert_allclose(frame.similarity, [[3 / 5, 0], [0, 0]])


def test_a_car_that_is_a_van_is_neither_right_nor_wrong():
    frame = ground_frame(labels(20.0, types=("Van",)), tracks(20.0), "Car")
    assert len(frame.truth_ids) == len(frame.track_ids) == 0
    frame = ground_frame(labels(20.0, types=("Truck",)), tracks(20.0), "Car")
    assert frame.track_ids.tolist() == [10]


def test_a_hidden_object_and_its_track_are_ignored():
    frame = ground_frame(labels(20.0, occlusion=3), tracks(20.0, 50.0), "Car")
    assert len(frame.truth_ids) == 0
    assert frame.track_ids.tolist() == [11]


def test_a_track_in_a_region_without_labels_is_ignored_unless_it_matches():
    region = (90, 90, 300, 200)
    frame = ground_frame(labels(20.0, region_px=region), tracks(20.0, 50.0), "Car")
    assert frame.track_ids.tolist() == [10]


@pytest.mark.parametrize(("kind", "ignored"), [("Pedestrian", 1), ("Van", 0)])
def test_the_minimum_overlap_is_that_of_the_class(kind, ignored):
    hidden = labels(20.0, types=(kind,), occlusion=3)
    frame = ground_frame(hidden, tracks(22.0, kind=kind), kind)  # an overlap of a third
    assert len(frame.track_ids) == 1 - ignored


def test_all_round_objects_count_that_a_return_is_of_and_that_are_near():
    ahead_m = np.array([20.0, 40.0, 60.0])
    points = np.column_stack([ahead_m[[0, 2]], np.zeros(2), np.full(2, -1.0)])
    around = measured_objects(labels(*ahead_m, occlusion=3), points)
    assert around.occlusion.tolist() == [0, 3, 3]
    found = tracks_around(tracks(20.0, 40.0, 55.0, 30.0))
    assert found.boxes.bottom_m[:, 0].tolist() == [20, 40, 30]
    frame = ground_frame(around, found, "Car")
    assert frame.truth_ids.tolist() == [0]
    assert frame.track_ids.tolist() == [10, 13]  # that of the object without a return is ignored
    np.testing.assert_allclose(frame.similarity, [[1, 0]])
