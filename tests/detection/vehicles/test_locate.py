"""Location of cars at known positions: their points, distances and boxes."""

from dataclasses import replace

import numpy as np
import pytest

from data.open_drive import open_drive
from perception.detection.vehicles.config import VehicleConfig
from perception.detection.vehicles.locate import locate
from perception.geometry.camera import box_outlines_px, project
from perception.geometry.se3 import wrap
from perception.maps.projection import VIRTUAL_CAMERA
from perception.types import Boxes3D, Detections, FusedDetections
from tests.vehicle_scenes import (
    CALIBRATION,
    SIZE_PX,
    FlatRoad,
    cars,
    detected,
    frame_of,
    rider,
    road,
    sides,
    visible_points,
    walker,
)

_GROUND = FlatRoad()


def axis_error_rad(found: Boxes3D, true: Boxes3D) -> np.ndarray:
    return np.abs(wrap(found.yaw_rad - true.yaw_rad, np.pi))


@pytest.mark.parametrize("yaw_deg", [0, 30, 60, 90, 120, 150])
@pytest.mark.parametrize(("x_m", "y_m"), [(8.0, 1.0), (15.0, -4.0), (30.0, 6.0)])
def test_a_car_is_located_at_its_position(x_m, y_m, yaw_deg):
    true = cars((x_m, y_m, np.radians(yaw_deg)))
    frame = frame_of(road(), sides(true))
    found = locate(detected(true), frame, _GROUND)
    np.testing.assert_allclose(found.boxes.bottom_m, true.bottom_m, atol=0.25)
    np.testing.assert_allclose(found.boxes.size_m, true.size_m, atol=0.5)
    assert axis_error_rad(found.boxes, true)[0] < np.radians(4)


def test_its_points_are_those_of_its_sides_and_its_distance_is_to_the_nearest():
    true = cars((12.0, 2.0, 0.4))
    body = sides(true)
    frame = frame_of(road(), body)
    found = locate(detected(true), frame, _GROUND)
    owned = np.flatnonzero(found.owners == 0)
    assert (owned >= len(road())).all()
    assert len(owned) >= 0.95 * len(body)
    assert found.distances_m[0] == pytest.approx(np.linalg.norm(body, axis=1).min(), abs=0.1)
    assert found.ids.tolist() == [-1]
    assert np.isnan(found.velocities_m_s).all()


def test_a_scan_of_another_time_locates_no_car():
    true = cars((12.0, 2.0, 0.4))
    frame = frame_of(road(), sides(true))
    found = locate(detected(true), frame, _GROUND, uses_scan=False)
    assert np.isnan(found.distances_m).all() and np.isnan(found.boxes.bottom_m).all()
    assert found.owners.tolist() == [-1] * len(frame.points_velo)


def test_without_a_ground_model_the_lowest_points_are_the_ground():
    true = cars((12.0, 2.0, 0.4))
    found = locate(detected(true), frame_of(road(), sides(true)), None)
    np.testing.assert_allclose(found.boxes.bottom_m, true.bottom_m, atol=0.2)
    assert not (found.owners[: len(road())] >= 0).any()


def test_points_above_a_car_are_not_its_own():
    true = cars((15.0, 0.0, 0.0))
    y, z = np.meshgrid(np.arange(-10, 10, 0.3), np.arange(-1.4, 2.0, 0.3))
    wall = np.column_stack([np.full(y.size, 35.0), y.ravel(), z.ravel()])
    found = locate(detected(true), frame_of(road(), wall, sides(true)), _GROUND)
    first = len(road())
    assert (found.owners[first : first + len(wall)] == -1).all()
    np.testing.assert_allclose(found.boxes.bottom_m, true.bottom_m, atol=0.2)


def test_a_pole_in_front_of_a_car_is_not_of_it():
    true = cars((20.0, 0.0, 0.0))
    z = np.arange(-1.4, 1.0, 0.1)
    pole = np.column_stack([np.full(len(z), 9.0), np.zeros(len(z)), z])
    found = locate(detected(true), frame_of(road(), pole, sides(true)), _GROUND)
    first = len(road())
    assert (found.owners[first : first + len(pole)] == -1).all()
    assert found.boxes.bottom_m[0, 0] == pytest.approx(20.0, abs=0.25)


def test_of_two_cars_that_overlap_in_the_image_each_has_its_own_points():
    true = cars((12.0, 0.0, 0.0), (22.0, -1.4, 0.0))
    near, far = sides(true[[0]]), sides(true[[1]])
    shown = far[np.arctan2(far[:, 1], far[:, 0]) < np.arctan2(-0.85, 10.0)]
    frame = frame_of(road(), near, shown)
    found = locate(detected(true), frame, _GROUND)
    first = len(road())
    near_owners = found.owners[first : first + len(near)]
    far_owners = found.owners[first + len(near) :]
    assert (near_owners == 0).mean() > 0.95
    assert (far_owners == 1).mean() > 0.95
    np.testing.assert_allclose(found.boxes.bottom_m[:, 0], [12.0, 22.0], atol=0.3)


def test_a_crowd_is_segmented():
    true = cars(*[(8.0 + 8 * row, 5.0 * side, 0.05 * row) for row in range(3) for side in (-1, 1)])
    frame = frame_of(visible_points(np.concatenate([road(), sides(true, step_m=0.08)])))
    found = locate(detected(true), frame, _GROUND)
    apart_m = np.linalg.norm(found.boxes.bottom_m[:, :2] - true.bottom_m[:, :2], axis=1)
    assert apart_m.max() < 0.3


def test_the_order_of_detections_does_not_matter():
    true = cars((10.0, 3.0, 0.1), (18.0, -2.0, 1.2), (25.0, 5.0, 0.8))
    frame, order = frame_of(road(), sides(true)), np.array([2, 0, 1])
    one = locate(detected(true), frame, _GROUND)
    other = locate(detected(true)[order], frame, _GROUND)
    np.testing.assert_allclose(other.boxes.bottom_m, one.boxes.bottom_m[order])
    np.testing.assert_allclose(other.boxes.yaw_rad, one.boxes.yaw_rad[order])
    np.testing.assert_array_equal(np.append(order, -1)[other.owners], one.owners)


def test_a_box_without_points_has_no_place():
    true = cars((12.0, 2.0, 0.4), (30.0, -5.0, 0.0))
    found = locate(detected(true), frame_of(road(), sides(true[[0]])), _GROUND)
    assert np.isnan(found.boxes.bottom_m[1]).all()
    assert np.isnan(found.boxes.size_m[1]).all()
    assert np.isnan(found.distances_m[1])
    assert np.isfinite(found.boxes.bottom_m[0]).all()


def test_two_returns_give_a_distance_but_no_box():
    true = cars((30.0, 0.0, 0.0))
    returns = np.array([[28.0, -0.3, -1.0], [28.0, 0.1, -1.0]])
    found = locate(detected(true), frame_of(road(), returns), _GROUND)
    assert np.isnan(found.boxes.yaw_rad[0])
    assert found.distances_m[0] == pytest.approx(np.linalg.norm(returns[1]), abs=1e-4)


def test_detections_below_the_minimum_score_are_not_located():
    true = cars((12.0, 4.0, 0.4), (20.0, -4.0, 0.0))
    frame = frame_of(road(), sides(true))
    found = locate(detected(true, np.array([0.04, 0.9])), frame, _GROUND)
    assert np.isfinite(found.boxes.yaw_rad).tolist() == [False, True]
    assert set(found.owners.tolist()) == {-1, 1}
    all_of_them = VehicleConfig(min_existence=0.0)
    found = locate(detected(true, np.array([0.04, 0.9])), frame, _GROUND, all_of_them)
    assert np.isfinite(found.boxes.yaw_rad).all()


@pytest.mark.parametrize("side", [-1, 1])
def test_of_a_car_that_the_images_border_cuts_the_lidar_sees_the_rest(side):
    true = cars((5.5, 4.6 * side, 0.0))
    body = sides(true)
    pixels, _ = project(CALIBRATION.image_P_velo, body)
    is_shown = (pixels[:, 0] >= 0) & (pixels[:, 0] < SIZE_PX[0])
    assert 0.2 < is_shown.mean() < 0.7
    found = locate(detected(true), frame_of(road(), body), _GROUND)
    # More than the image shows; what is nearer reaches farther up and down than the box.
    assert (found.owners[len(road()) :] == 0).mean() > 0.75
    np.testing.assert_allclose(found.boxes.bottom_m, true.bottom_m, atol=0.25)
    assert axis_error_rad(found.boxes, true)[0] < np.radians(4)


def test_one_object_of_two_classes_has_the_same_returns_twice():
    true = cars((10.0, 3.0, 0.0), size_m=(1.76, 0.6, 1.74))
    twice = _people(true, "Cyclist").joined(_people(true, "Pedestrian"))
    faint = replace(twice, existence=np.array([0.2, 0.9]))
    found = locate(faint, frame_of(road(), rider(true)), _GROUND)
    assert set(found.owners.tolist()) == {-1, 1}
    np.testing.assert_allclose(found.boxes.bottom_m[0, :2], true.bottom_m[0, :2], atol=0.15)
    np.testing.assert_allclose(found.boxes.bottom_m[1, :2], true.bottom_m[0, :2], atol=0.15)
    assert found.boxes.size_m[:, 0].tolist() == [1.76, 0.84]
    assert found.distances_m[0] == found.distances_m[1]


def test_a_faint_detection_takes_no_returns_of_a_certain_one():
    true = cars((12.0, 0.0, 0.0))
    body = sides(true)
    certain = detected(true)
    boxes_px = certain.detections.boxes_px
    shift_px = 0.3 * (boxes_px[0, 2] - boxes_px[0, 0]) * np.array([1, 0, 1, 0])
    moved = replace(certain.detections, boxes_px=boxes_px + shift_px)
    faint = replace(certain, detections=moved, existence=np.array([0.15]))
    found = locate(faint.joined(certain), frame_of(road(), body), _GROUND)
    assert (found.owners[len(road()) :] == 1).mean() > 0.95
    np.testing.assert_allclose(found.boxes.bottom_m[1], true.bottom_m[0], atol=0.25)


@pytest.mark.parametrize(("side", "ahead"), [("right", [False, True]), ("left", [True, True])])
def test_beyond_the_own_lane_traffic_comes_towards_the_sensor(side, ahead):
    true = cars((15.0, 4.0, 0.2), (15.0, -1.0, 0.2))
    config = VehicleConfig(traffic_side=side)
    found = locate(detected(true), frame_of(road(), sides(true)), _GROUND, config)
    assert (np.cos(found.boxes.yaw_rad) > 0).tolist() == ahead
    assert axis_error_rad(found.boxes, true).max() < np.radians(4)


def test_no_detections_give_no_vehicles():
    found = locate(FusedDetections.empty(), frame_of(road()), _GROUND)
    assert len(found) == 0
    assert (found.owners == -1).all()


def test_boxes_at_and_beyond_the_borders_are_no_fault():
    true = cars((5.0, 3.2, 0.0), (12.0, 0.0, 0.0))
    fused = detected(true)
    odd_px = np.array([[-50.0, -20, 1300, 500], [600, 200, 600, 200], *fused.detections.boxes_px])
    odd = type(fused.detections)(odd_px, np.full(4, 0.5), np.full(4, "Car"))
    found = locate(
        FusedDetections(odd, np.full((4, 3), -1), np.zeros(4, int), odd.scores),
        frame_of(road(), sides(true)),
        _GROUND,
    )
    assert len(found) == 4
    assert found.boxes.bottom_m[3, 0] == pytest.approx(12.0, abs=0.3)


@pytest.mark.parametrize(
    ("name", "size_m"),
    [
        ("Van", (5.0, 1.9, 2.2)),
        ("Truck", (10.0, 2.6, 4.2)),
        ("Car", (4.0, 1.65, 1.5)),
        ("Wagon", (4.0, 1.65, 1.5)),
    ],
)
def test_a_box_has_the_size_of_its_class(name, size_m):
    true = cars((14.0, 3.0, 0.4), (16.0, -5.0, 0.0), size_m=size_m)
    seen = detected(true)
    fused = replace(seen, detections=replace(seen.detections, types=np.array([name, "Car"])))
    found = locate(fused, frame_of(road(), sides(true)), _GROUND)
    np.testing.assert_allclose(found.boxes.size_m[0], size_m, atol=0.45)
    np.testing.assert_allclose(found.boxes.bottom_m[0], true.bottom_m[0], atol=0.3)
    alone = locate(fused[1:], frame_of(road(), sides(true[1:])), _GROUND)
    np.testing.assert_allclose(found.boxes.size_m[1], alone.boxes.size_m[0])


@pytest.mark.parametrize(("x_m", "y_m"), [(8.0, 2.0), (15.0, -5.0), (35.0, 3.0)])
@pytest.mark.parametrize("yaw_deg", [-60, 0, 30])
def test_a_cyclist_is_located_by_the_returns_around_the_middle(x_m, y_m, yaw_deg):
    true = cars((x_m, y_m, np.radians(yaw_deg)), size_m=(1.76, 0.6, 1.74))
    found = locate(_people(true, "Cyclist"), frame_of(road(), rider(true)), _GROUND)
    np.testing.assert_allclose(found.boxes.bottom_m, true.bottom_m, atol=0.15)
    np.testing.assert_allclose(found.boxes.size_m, true.size_m, atol=0.1)
    assert axis_error_rad(found.boxes, true)[0] < np.radians(15)


@pytest.mark.parametrize(("x_m", "y_m"), [(8.0, 2.0), (15.0, -5.0), (35.0, 3.0)])
def test_a_pedestrian_is_behind_the_returns(x_m, y_m):
    true = cars((x_m, y_m, 0.0), size_m=(0.84, 0.66, 1.76))
    found = locate(_people(true, "pedestrian"), frame_of(road(), walker(true)), _GROUND)
    np.testing.assert_allclose(found.boxes.bottom_m, true.bottom_m, atol=0.1)
    np.testing.assert_allclose(found.boxes.size_m, true.size_m, atol=0.1)


def test_two_people_who_meet_are_two_clusters():
    true = cars((12.0, 0.0, 0.0), (12.0, 0.75, 0.0), size_m=(0.84, 0.66, 1.76))
    found = locate(_people(true, "Pedestrian"), frame_of(road(), walker(true)), _GROUND)
    np.testing.assert_allclose(found.boxes.bottom_m, true.bottom_m, atol=0.12)


def test_a_car_and_a_pedestrian_keep_their_order_and_sizes():
    person, car = cars((10.0, 3.0, 0.0), size_m=(0.84, 0.66, 1.76)), cars((15.0, -3.0, 0.0))
    people, vehicles = _people(person, "Pedestrian"), detected(car)
    frame = frame_of(road(), walker(person), sides(car))
    for fused in (people.joined(vehicles), vehicles.joined(people)):
        found = locate(fused, frame, _GROUND)
        is_person = fused.detections.types == "Pedestrian"
        np.testing.assert_allclose(found.boxes.bottom_m[is_person], person.bottom_m, atol=0.12)
        np.testing.assert_allclose(found.boxes.bottom_m[~is_person], car.bottom_m, atol=0.25)


@pytest.mark.parametrize("height_m", [1.4, 1.75])
def test_the_height_of_what_hides_its_roof_is_that_of_the_2d_box(height_m):
    true = cars((25.0, 3.0, 0.2), size_m=(4.0, 1.65, height_m))
    body = sides(true)
    shown = body[body[:, 2] < true.bottom_m[0, 2] + 0.9]
    found = locate(detected(true), frame_of(road(), shown), _GROUND)
    assert found.boxes.size_m[0, 2] == pytest.approx(height_m, abs=0.08)


def test_on_a_slope_a_box_stands_on_the_ground_below_its_points():
    true = cars((15.0, 0.0, 0.0))
    slope = np.array([0.0, 0.0, 0.06])
    lifted = [part + part[:, :1] * slope for part in (road(step_m=0.2), sides(true))]
    raised = replace(true, bottom_m=true.bottom_m + 15.0 * slope)
    found = locate(detected(raised), frame_of(*lifted), None)
    assert found.boxes.bottom_m[0, 2] == pytest.approx(raised.bottom_m[0, 2], abs=0.15)


def test_without_a_camera_boxes_belong_to_the_virtual_one():
    (true,) = (cars((15.0, 2.0, 0.3)),)
    size_px = VIRTUAL_CAMERA.image_size_px
    seen_px = box_outlines_px(VIRTUAL_CAMERA.image_P_velo, true, size_px)
    fused = FusedDetections.unfused(Detections(seen_px, np.array([0.9]), np.array(["Car"])))
    frame = replace(frame_of(road(), sides(true)), calibration=None)
    found = locate(fused, frame, FlatRoad())
    np.testing.assert_allclose(found.boxes.bottom_m, true.bottom_m, atol=0.3)


def test_labelled_cars_of_real_frames_are_located_well(kitti_root):
    drive = open_drive(kitti_root / "object")
    apart_m, turned_rad = [], []
    for index in range(0, len(drive), 2):
        frame, labels = drive[index], drive.labels(index)
        found = locate(_as_detections(labels.boxes_px), frame, None)
        rows = (labels.types == "Car") & (labels.occlusion == 0) & (labels.truncation <= 0.3)
        apart = found.boxes.bottom_m[rows] - labels.boxes_velo.bottom_m[rows]
        apart_m += np.hypot(apart[:, 0], apart[:, 1]).tolist()
        turned_rad += axis_error_rad(found.boxes[rows], labels.boxes_velo[rows]).tolist()
    assert len(apart_m) >= 20
    assert np.isfinite(apart_m).mean() > 0.85
    assert np.nanmedian(apart_m) < 0.3
    assert np.nanmedian(turned_rad) < np.radians(4)


def _people(boxes: Boxes3D, name: str) -> FusedDetections:
    fused = detected(boxes)
    types = np.full(len(boxes), name)
    return replace(fused, detections=replace(fused.detections, types=types))


def _as_detections(boxes_px: np.ndarray) -> FusedDetections:
    found = detected(Boxes3D.empty()).detections
    count = len(boxes_px)
    found = type(found)(boxes_px, np.ones(count), np.full(count, "Car"))
    return FusedDetections(found, np.full((count, 3), -1), np.zeros(count, int), found.scores)
