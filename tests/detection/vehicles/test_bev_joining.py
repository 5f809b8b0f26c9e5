"""Objects of the bird's-eye view beside those of a camera that looks ahead."""

from dataclasses import replace

import numpy as np
import pytest

from perception.detection.bev.boxes import BevDetections
from perception.detection.vehicles.bev_joining import join_bev
from perception.detection.vehicles.bev_objects import bev_vehicles, owners_of_points
from perception.detection.vehicles.locate import locate
from perception.geometry.box_overlap import iou_bev
from perception.geometry.camera import box_outlines_px
from perception.tracking.vehicles.tracker import VehicleTracker
from perception.types import Boxes3D, Vehicles
from tests.vehicle_scenes import (
    CALIBRATION,
    SIZE_PX,
    FlatRoad,
    cars,
    detected,
    frame_of,
    observed_from,
    road,
    sides,
)

CLASSES = ("Car", "Truck", "Pedestrian", "Bus")
AHEAD, BEHIND, BESIDE = (15.0, 3.0, 0.2), (-12.0, -3.0, 0.1), (2.0, 9.0, 1.5)


def above(boxes: Boxes3D, *, score: float = 0.6, number: int = 0, position_m: float = 0.1):
    """Return boxes as a detector from above states them."""
    count = len(boxes)
    deviations = np.tile([position_m, 0.1, 0.1, 0.05, 0.05, 0.03], (count, 1))
    scores, classes = np.full(count, score), np.full(count, number)
    return BevDetections(boxes, classes, scores, deviations, np.full(count, 0.05))


def seen_by_both(boxes: Boxes3D, found: BevDetections, score: float = 0.6, kind: str = "Car"):
    """Return the frame of some cars, what a camera shows of them, and what is seen from above."""
    frame = frame_of(road(), sides(boxes))
    in_camera = box_outlines_px(CALIBRATION.image_P_velo, boxes, SIZE_PX)
    shown = boxes[np.isfinite(in_camera).all(axis=1)]
    fused = detected(shown, score)
    types = np.full(len(shown), kind)
    fused = replace(fused, detections=replace(fused.detections, types=types))
    located = locate(fused, frame, FlatRoad())
    return frame, located, bev_vehicles(found, CLASSES, frame)


def test_a_car_of_camera_and_view_from_above_is_one_with_the_better_box_and_a_higher_score():
    true = cars(AHEAD)
    frame, located, found = seen_by_both(true, above(true))
    joined = join_bev(located, found, frame, {0: 1.0})
    assert len(joined) == 1
    np.testing.assert_array_equal(
        joined.fused.detections.boxes_px, located.fused.detections.boxes_px
    )
    np.testing.assert_allclose(joined.boxes.bottom_m, true.bottom_m)
    assert joined.fused.detections.scores[0] > 0.6
    assert joined.fused.detections.types.tolist() == ["Car"]
    assert (joined.cameras[0], joined.bev_scores[0], joined.dominant_modalities[0]) == (
        0,
        0.6,
        "rgb",
    )
    assert joined.point_counts[0] > 50
    assert joined.box_deviations.yaw_rad[0] == pytest.approx(0.03)


def test_a_box_of_large_deviations_does_not_replace_that_of_the_camera():
    true = cars(AHEAD)
    off = replace(true, bottom_m=true.bottom_m + np.array([0.6, 0, 0]))
    frame, located, found = seen_by_both(true, above(off, position_m=3.0))
    joined = join_bev(located, found, frame, {0: 1.0})
    assert len(joined) == 1
    np.testing.assert_array_equal(joined.boxes.bottom_m, located.boxes.bottom_m)


def test_the_front_is_that_of_the_surer_one_whichever_box_is_taken():
    true = cars((15.0, 3.0, 0.2 - np.pi))  # against the traffic
    for reversal, is_turned in ((0.02, True), (0.4, False)):
        found = replace(above(true, position_m=3.0), reversals=np.array([reversal]))
        frame, located, seen = seen_by_both(true, found)
        if not is_turned:
            located = replace(located, boxes=replace(located.boxes, yaw_rad=np.array([0.2])))
        joined = join_bev(located, seen, frame, {0: 1.0})
        np.testing.assert_array_equal(joined.boxes.bottom_m, located.boxes.bottom_m)
        assert (np.cos(joined.boxes.yaw_rad[0] - true.yaw_rad[0]) > 0.9) == is_turned
        assert joined.box_deviations.reversal[0] == min(reversal, 0.1)


def test_what_the_view_from_above_does_not_find_stays_as_the_camera_shows_it():
    true = cars(AHEAD, (25.0, -4.0, 0.0))
    frame, located, found = seen_by_both(true, above(true[:0]))
    joined = join_bev(located, found, frame, {0: 1.0})
    for name in ("scores", "boxes_px"):
        np.testing.assert_array_equal(
            getattr(joined.fused.detections, name), getattr(located.fused.detections, name)
        )
    np.testing.assert_array_equal(joined.boxes.bottom_m, located.boxes.bottom_m)
    np.testing.assert_array_equal(joined.owners, located.owners)
    assert np.isnan(joined.bev_scores).all()


def test_a_weak_detection_in_an_image_speaks_no_more_against_an_object_than_none():
    true = cars(AHEAD)
    frame, weak, found = seen_by_both(true, above(true, score=0.8), score=0.02)
    none = join_bev(Vehicles.empty(len(frame.points_velo)), found, frame, {0: 1.0})
    joined = join_bev(weak, found, frame, {0: 1.0})
    assert (len(joined), joined.dominant_modalities[0]) == (1, "rgb")
    assert joined.fused.existence[0] == pytest.approx(none.fused.existence[0])
    unsearched = join_bev(weak, found, frame, {})
    assert unsearched.fused.existence[0] == pytest.approx(found.fused.existence[0])


def test_only_what_a_camera_should_show_and_does_not_has_a_lower_score():
    true = cars(AHEAD, BEHIND)
    frame, _, found = seen_by_both(true, above(true))
    own = found.fused.detections.scores
    unseen = join_bev(Vehicles.empty(len(frame.points_velo)), found, frame, {0: 1.0})
    behind, ahead = 0, 1  # best first
    assert unseen.cameras.tolist() == [-1, 0]
    assert unseen.fused.detections.scores[behind] == own[1]
    assert unseen.fused.detections.scores[ahead] < own[0]
    assert np.isnan(unseen.fused.detections.boxes_px[behind]).all()
    assert unseen.dominant_modalities.tolist() == ["bev", "bev"]
    unsearched = join_bev(Vehicles.empty(len(frame.points_velo)), found, frame, {})
    assert unsearched.fused.detections.scores.tolist() == own.tolist()


def test_a_bus_that_a_camera_calls_a_truck_is_a_bus_and_stays_one():
    true = cars((20.0, 3.0, 0.1), size_m=(11.0, 2.9, 3.1))
    tracker, bus = VehicleTracker(), CLASSES.index("Bus")
    for index in range(3):
        frame, located, found = seen_by_both(true, above(true, number=bus), kind="Truck")
        frame = replace(frame, index=index, stamp_s=0.1 * index)
        joined = join_bev(located, found, frame, {0: 1.0})
        named = joined.fused.detections.types.tolist(), joined.bev_types.tolist()
        assert named == (["Truck"], ["Bus"])
        tracked = tracker.update(joined, frame, np.eye(4)).vehicles
    assert tracked.fused.detections.types.tolist() == ["Bus"]
    assert tracked.ids[0] >= 0


def test_the_likeliest_class_of_a_camera_takes_the_surest_box_from_above():
    true = cars((20.0, 3.0, 0.1), size_m=(11.0, 2.9, 3.1))
    part = replace(true, size_m=np.array([[7.0, 2.4, 2.9]]))
    whole, front = above(true, score=0.6, number=3), above(part, score=0.12, number=1)
    frame, located, found = seen_by_both(true, whole.joined(front), kind="Truck")
    other = located.with_detections(scores=np.array([0.2]), types=np.array(["Van"]))
    both = Vehicles.concatenate([located, other], located.owners)
    existence = np.array([0.8, 0.3])
    both = replace(both, fused=replace(both.fused, existence=existence))
    joined = join_bev(both, found, frame, {0: 1.0})
    named = dict(zip(joined.fused.detections.types, joined.bev_types, strict=True))
    assert named == {"Truck": "Bus", "Van": ""}


def test_a_person_before_a_car_and_a_car_behind_another_stay_two():
    true = cars(AHEAD)
    person = cars((11.0, 2.2, 0.0), size_m=(0.7, 0.6, 1.75))
    frame, located, found = seen_by_both(true, above(person, number=2))
    assert len(join_bev(located, found, frame, {0: 1.0})) == 2
    farther = cars((22.0, 4.4, 0.2))
    frame, located, found = seen_by_both(true, above(farther))
    assert len(join_bev(located, found, frame, {0: 1.0})) == 2


def test_returns_above_the_ground_belong_to_the_box_around_them():
    boxes = cars(AHEAD, BEHIND, (15.5, 3.0, 0.2))
    points = np.array(
        [[15, 3, -1.0, 0], [15, 3, -1.68, 0], [-12, -3, -0.5, 0], [15, 3, 1.0, 0], [0, 0, 0, 0]]
    ).astype(np.float32)
    assert owners_of_points(boxes, points).tolist() == [0, -1, 1, -1, -1]
    assert owners_of_points(boxes[:0], points).tolist() == [-1] * 5


def test_a_car_keeps_its_id_all_round_without_a_camera_and_into_its_view():
    parked = cars(*((20.0 + step, 4.0, 0.0) for step in (0,)))
    tracker, ids, errors_m = VehicleTracker(), set(), []
    for index in range(40):
        pose, boxes = observed_from(float(index), parked)
        frame = frame_of(road(), sides(boxes), index=index, pose=pose)
        found = bev_vehicles(above(boxes), CLASSES, frame)
        searched = {0: 1.0}
        vehicles = join_bev(Vehicles.empty(len(frame.points_velo)), found, frame, searched)
        tracked = tracker.update(vehicles, frame, pose).vehicles
        assert len(tracked) == 1
        assert (tracked.cameras[0] >= 0) == np.isfinite(tracked.fused.detections.boxes_px).all()
        errors_m.append(np.linalg.norm(tracked.boxes.bottom_m[0] - boxes.bottom_m[0]))
        assert iou_bev(tracked.boxes, boxes)[0, 0] > 0.7
        ids.add(int(tracked.ids[0]))
    assert tracked.cameras.tolist() == [-1]
    assert len(ids - {-1}) == 1
    assert max(errors_m) < 0.3
