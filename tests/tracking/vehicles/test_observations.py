"""Where detections are in the world: by their returns, else by their height in the image."""

from dataclasses import replace

import numpy as np
import pytest

from perception.detection.vehicles.locate import locate
from perception.geometry import se3
from perception.tracking.vehicles.observations import FrameGeometry, VehicleObservations
from tests.vehicle_scenes import CALIBRATION, FlatRoad, cars, detected, frame_of, road, sides

_POSE = se3.from_euler(0.01, -0.02, 0.6, np.array([100.0, -50.0, 3.0]))
_CLASSES = np.array(["Car", "Van"])
_GEOMETRY = FrameGeometry(0.0, _POSE, CALIBRATION.image_P_velo, (1242, 375))


def test_a_pixel_and_its_depth_are_the_point_again():
    points_velo = np.array([[20.0, 3.0, -1.0], [50.0, -8.0, 0.5]])
    points_world = points_velo @ _POSE[:3, :3].T + _POSE[:3, 3]
    seen = _GEOMETRY.project(points_world)
    np.testing.assert_allclose(seen[:, 2], points_velo[:, 0] - 0.27, atol=1e-9)
    np.testing.assert_allclose(_GEOMETRY.unproject(seen[:, :2], seen[:, 2]), points_world)


def test_the_focal_length_is_that_of_the_camera():
    assert pytest.approx(720.0) == _GEOMETRY.focal_px


def test_a_box_that_leaves_the_image_ends_at_its_edge():
    boxes_px = np.array([[-30.0, 246.0, 98.0, 400.0], [1200.0, -5.0, 1300.0, 90.0], [np.nan] * 4])
    np.testing.assert_array_equal(
        _GEOMETRY.clip(boxes_px), [[0, 246, 98, 374], [1200, 0, 1241, 90], [np.nan] * 4]
    )


def test_an_object_is_as_likely_as_its_detector_says_whatever_the_score_of_its_box():
    fused = replace(detected(cars((20.0, 4.0, 0.0)), 0.3), existence=np.array([0.97]))
    vehicles = locate(fused, frame_of(road()), FlatRoad())
    seen = VehicleObservations.of(vehicles, [_GEOMETRY], _CLASSES, 0.2)
    np.testing.assert_allclose(seen.existence, [0.97])


@pytest.mark.parametrize(
    ("name", "size_m", "existence", "expected"),
    [
        ("Cyclist", (1.7, 0.6, 1.7), 0.93, 0.93),  # log-odds of 2.6
        ("Cyclist", (1.7, 0.6, 1.05), 0.93, 0.40),  # nobody rides it: 3 less
        ("Pedestrian", (0.6, 0.6, 1.0), 0.93, 0.40),  # a post
        ("Car", (4.0, 1.6, 1.5), 0.9, 0.9),
        ("Car", (2.0, 0.8, 0.9), 0.9, 0.31),  # a motorcycle
        ("Car", (5.0, 1.9, 2.1), 0.9, 0.9),  # a van
    ],
)
def test_an_object_too_low_for_its_class_is_doubtful(name, size_m, existence, expected):
    boxes = cars((12.0, 2.0, 0.0), size_m=size_m)
    shown = replace(detected(boxes, 0.9), existence=np.array([existence]))
    shown = replace(shown, detections=replace(shown.detections, types=np.array([name])))
    vehicles = locate(shown, frame_of(road(), sides(boxes)), FlatRoad())
    classes = vehicles.fused.detections.types  # the van's by its height
    seen = VehicleObservations.of(vehicles, [_GEOMETRY], classes, 0.2)
    assert seen.is_located.all()
    np.testing.assert_allclose(seen.existence, [expected], atol=0.03)


def test_the_height_of_what_the_upper_border_cuts_is_not_known():
    boxes = cars((12.0, 2.0, 0.0), size_m=(1.7, 0.6, 1.05))
    shown = replace(detected(boxes, 0.6), existence=np.array([0.69]))
    boxes_px = shown.detections.boxes_px * [1, 0, 1, 1]
    types = np.array(["Cyclist"])
    shown = replace(shown, detections=replace(shown.detections, boxes_px=boxes_px, types=types))
    vehicles = locate(shown, frame_of(road(), sides(boxes)), FlatRoad())
    seen = VehicleObservations.of(vehicles, [_GEOMETRY], types, 0.2)
    assert seen.existence[0] == pytest.approx(0.69, abs=0.01)


def test_existence_of_two_classes_at_one_place_adds_up():
    shown = detected(cars((20.0, 4.0, 0.0), (20.0, 4.0, 0.0), (20.0, -4.0, 0.0)), [0.5, 0.3, 0.4])
    types = np.array(["Car", "Van", "Van"])
    shown = replace(shown, detections=replace(shown.detections, types=types))
    vehicles = locate(shown, frame_of(road()), FlatRoad())
    seen = VehicleObservations.of(vehicles, [_GEOMETRY], _CLASSES, 0.2)
    np.testing.assert_allclose(seen.existence, [0.8, 0.8, 0.4])


def test_a_detection_without_returns_is_about_where_its_height_says():
    boxes = cars((30.0, 4.0, 0.0), (60.0, -4.0, 0.0), size_m=(4.0, 1.65, 1.6))
    frame = frame_of(road(step_m=1.0))
    vehicles = locate(detected(boxes), frame, FlatRoad())
    seen = VehicleObservations.of(vehicles, [_GEOMETRY], _CLASSES, 0.2)
    assert not seen.is_located.any()
    expected = (boxes.bottom_m @ _POSE[:3, :3].T + _POSE[:3, 3])[:, :2]
    # The nearer end of a car gives the height of its box.
    off_m = seen.boxes_world.bottom_m[:, :2] - expected
    assert (np.linalg.norm(off_m, axis=1) < 3.0).all()
    # Well known across the line of sight, hardly along it.
    variances = np.linalg.eigvalsh(seen.noise)
    assert (variances[:, 0] < 0.5**2).all()
    assert (variances[:, 1] > 8.0**2).all()


def test_a_detection_with_returns_is_where_they_are():
    boxes = cars((20.0, 4.0, 0.0))
    vehicles = locate(detected(boxes), frame_of(road(), sides(boxes)), FlatRoad())
    seen = VehicleObservations.of(vehicles, [_GEOMETRY], _CLASSES, 0.2)
    assert seen.is_located.all()
    expected = boxes.bottom_m @ _POSE[:3, :3].T + _POSE[:3, 3]
    np.testing.assert_allclose(seen.boxes_world.bottom_m, expected, atol=0.3)


def test_the_existence_of_an_object_of_two_classes_is_a_probability():
    shown = detected(cars((20.0, 4.0, 0.0), (20.0, 4.0, 0.0)), [0.8, 0.7])
    shown = replace(shown, detections=replace(shown.detections, types=np.array(["Car", "Van"])))
    vehicles = locate(shown, frame_of(road()), FlatRoad())
    seen = VehicleObservations.of(vehicles, [_GEOMETRY], _CLASSES, 0.2)
    assert seen.existence.max() == pytest.approx(0.98)  # no single detection settles a track
