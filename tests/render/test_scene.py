"""Which objects of a result are drawn: every one once, with what is known of it."""

from dataclasses import replace

import numpy as np
import pytest

from perception.render.scene import SceneObjects, SelectedObject
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import BoxDeviations, Boxes3D, Detections, FusedDetections, Tracks, Vehicles

UNKNOWN = [np.nan] * 3


@pytest.fixture
def detected(scene):
    """Two cars, the first with a 3D box and an id, and an unlikely one."""
    boxes_px = np.array([[80.0, 40, 120, 70], [20, 40, 40, 60], [10, 10, 30, 30]])
    fused = Detections(boxes_px, np.array([0.9, 0.7, 0.2]), np.full(3, "Car"))
    vehicles = Vehicles(
        FusedDetections(
            fused, np.array([[0, 0, -1], [1, -1, -1], [2, -1, -1]]), np.zeros(3, int), fused.scores
        ),
        np.array([4, -1, 6]),
        Boxes3D(
            np.array([[12, 0, -1.7], UNKNOWN, UNKNOWN]),
            np.array([[4, 1.8, 1.5], UNKNOWN, UNKNOWN]),
            np.array([0, np.nan, np.nan]),
        ),
        np.array([10.0, np.nan, np.nan]),
        np.array([[2.0, 0], [np.nan, np.nan], [np.nan, np.nan]]),
        np.full((3, 4, 4), np.nan),
        BoxDeviations.unknown(3),
        np.full(4, -1),
    )
    return replace(scene, vehicles=vehicles)


def track(track_id, velocity=(3.0, 0.0)):
    box = Boxes3D(np.array([[9.0, 2, -1.7]]), np.array([[4.0, 1.8, 1.5]]), np.zeros(1))
    return Tracks.unclassified(
        np.array([track_id]), box, np.array([velocity], float), np.ones(1, bool)
    )


def test_vehicles_from_a_score_on_are_objects(detected):
    objects = SceneObjects.of(detected)
    assert objects.ids.tolist() == [4, -1]
    assert objects.types.tolist() == ["Car", "Car"]
    assert objects.scores.tolist() == [0.9, 0.7]
    assert objects.has_box.tolist() == [True, False]
    np.testing.assert_allclose(objects.distances_m, [12, np.inf])
    assert len(SceneObjects.of(detected, display_score=0.1)) == 3


def test_a_vehicle_that_is_also_a_track_is_drawn_once(detected):
    objects = SceneObjects.of(replace(detected, tracks=track(4)))
    assert objects.ids.tolist() == [4, -1]
    # The box is that of the track, the rectangle that of the detection.
    np.testing.assert_allclose(objects.boxes.bottom_m[0], [9, 2, -1.7])
    np.testing.assert_allclose(objects.boxes_px[0], [80, 40, 120, 70])


def test_an_object_below_half_a_metre_per_second_is_drawn_static(scene):
    for speed_m_s, is_moving in ((0.49, False), (0.51, True)):
        objects = SceneObjects.of(replace(scene, tracks=track(1, (0.0, speed_m_s))))
        assert objects.is_moving.tolist() == [is_moving]
        assert objects.has_front.tolist() == [is_moving]


def test_the_selected_object_replaces_that_of_the_pipeline(detected):
    box = Boxes3D(np.array([[11.0, 1, -1.7]]), np.array([[4.0, 1.8, 1.5]]), np.zeros(1))
    tracked = TrackedObject(TrackStatus.PREDICTED, box, np.array([1.0, 0]), None)
    objects = SceneObjects.of(detected, selected=SelectedObject(4, tracked))
    assert objects.ids.tolist() == [-1, 4]
    assert objects.is_selected.tolist() == [False, True]
    assert objects.statuses[1] == "predicted"
    assert not objects.is_observed[1]
    assert (objects.types[1], objects.scores[1]) == ("Car", 0.9)
    np.testing.assert_allclose(objects.boxes.bottom_m[1], [11, 1, -1.7])
    unlocated = replace(tracked, box_velo=None)
    same = SceneObjects.of(detected, selected=SelectedObject(4, unlocated))
    assert same.ids.tolist() == [4, -1]


def test_a_lost_object_does_not_move():
    box = Boxes3D(np.array([[11.0, 1, -1.7]]), np.array([[4.0, 1.8, 1.5]]), np.zeros(1))
    tracked = TrackedObject(TrackStatus.LOST, box, np.array([5.0, 0]), None)
    objects = SceneObjects.of_tracked(tracked)
    assert not objects.is_moving[0]
    assert objects.statuses.tolist() == ["lost"]


def test_a_colour_belongs_to_an_id(detected):
    objects = SceneObjects.of(detected)
    known, unknown, foreign = objects.colors_of(np.array([4, -1, 99]))
    assert unknown == foreign != known
