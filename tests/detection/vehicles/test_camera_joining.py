"""Two cameras that overlap: one looks ahead, one to the left, and each sees a part of what is between them."""

from dataclasses import replace

import numpy as np
import pytest

from perception.detection.vehicles.camera_joining import join_cameras
from perception.detection.vehicles.locate import locate
from perception.errors import UsageError
from perception.geometry import se3
from perception.geometry.box_overlap import iou_bev
from perception.geometry.camera import box_outlines_px
from perception.tracking.vehicles.tracker import VehicleTracker
from perception.types import (
    MODALITIES,
    Calibration,
    CameraImage,
    Detections,
    FusedDetections,
)
from tests.vehicle_scenes import CALIBRATION, SIZE_PX, FlatRoad, cars, frame_of, road, sides

_GROUND = FlatRoad()
# The view ahead is 81 degrees wide, so that both overlap by 21 degrees.
_LEFT = Calibration(
    CALIBRATION.image_P_cam,
    CALIBRATION.cam_SE3_velo @ se3.inverse(se3.from_euler(0.0, 0.0, np.radians(60))),
    SIZE_PX,
)


def detected_in(calibration: Calibration, boxes, score: float = 0.9) -> FusedDetections:
    """Return what a perfect detector finds in the image of a camera: outlines of boxes that are in it."""
    boxes_px = box_outlines_px(calibration.image_P_velo, boxes, SIZE_PX)
    boxes_px = boxes_px[np.isfinite(boxes_px).all(axis=1)]
    count = len(boxes_px)
    scores = np.full(count, score)
    sources = np.zeros((count, len(MODALITIES)), int)
    found = Detections(boxes_px, scores, np.full(count, "Car"))
    return FusedDetections(found, sources, np.zeros(count, int), scores)


def frame_with_both(boxes, stamp_s=0.0):
    frame = frame_of(road(), sides(boxes))
    return replace(
        frame, camera="front", further_cameras=(CameraImage("left", _LEFT),), stamp_s=stamp_s
    )


def located_by_both(boxes, scores=(0.9, 0.9), stamp_s=0.0):
    frame = frame_with_both(boxes, stamp_s)
    located = {
        camera: locate(detected_in(one, boxes, score), frame.views[camera], _GROUND)
        for camera, (one, score) in enumerate(zip((CALIBRATION, _LEFT), scores, strict=True))
    }
    return frame, located


def at_deg(bearing_deg: float, away_m: float = 15.0, yaw_rad: float = 0.3):
    bearing = np.radians(bearing_deg)
    return cars((away_m * np.cos(bearing), away_m * np.sin(bearing), yaw_rad))


def test_a_car_that_both_see_is_one_vehicle_of_the_surer_camera():
    true = at_deg(30)
    for scores, camera in (((0.9, 0.6), 0), ((0.6, 0.9), 1)):
        frame, located = located_by_both(true, scores)
        assert [len(one) for one in located.values()] == [1, 1]
        joined = join_cameras(located, frame)
        assert joined.cameras.tolist() == [camera]
        assert iou_bev(joined.boxes, true)[0, 0] > 0.6
        assert joined.fused.detections.scores.tolist() == [max(scores)]
        owned = {camera: np.flatnonzero(one.owners == 0) for camera, one in located.items()}
        both = np.union1d(owned[0], owned[1])
        np.testing.assert_array_equal(np.flatnonzero(joined.owners == 0), both)
        assert joined.distances_m[0] == min(one.distances_m[0] for one in located.values())


def test_the_camera_that_shows_all_of_a_car_keeps_it():
    frame, located = located_by_both(
        at_deg(39)
    )  # the right half is cut off in neither, the left one ahead
    cut_px = located[0].fused.detections.boxes_px
    assert cut_px[0, 0] == 0
    assert join_cameras(located, frame).cameras.tolist() == [1]


def test_cars_side_by_side_stay_two():
    true = cars((13.0, 7.0, 0.0), (17.5, 7.4, 0.0))
    frame, located = located_by_both(true)
    joined = join_cameras(located, frame)
    assert len(joined) == 2
    assert iou_bev(joined.boxes, true).max(axis=0).min() > 0.5


def test_a_car_without_returns_is_joined_in_the_image():
    true = at_deg(30, away_m=60.0)
    frame = replace(frame_with_both(true), points_velo=frame_of(road()).points_velo)
    located = {
        camera: locate(detected_in(one, true), frame.views[camera], _GROUND)
        for camera, one in enumerate((CALIBRATION, _LEFT))
    }
    assert all(np.isnan(one.distances_m).all() for one in located.values())
    assert len(join_cameras(located, frame)) == 1


def test_one_camera_is_left_as_it_is():
    _, located = located_by_both(at_deg(10))
    assert join_cameras({0: located[0]}, frame_of(road())) is located[0]


def test_a_dark_main_camera_leaves_the_other_one():
    frame, located = located_by_both(at_deg(30))
    joined = join_cameras({1: located[1]}, frame)
    assert joined.cameras.tolist() == [1]


def test_a_car_that_crosses_from_one_view_to_the_other_keeps_its_id():
    tracker, ids, cameras = VehicleTracker(), [], []
    for step in range(22):
        true = cars((20.0 - 0.9 * step, 9.0, np.pi))  # oncoming, at 9 m/s
        frame, located = located_by_both(true, stamp_s=0.1 * step)
        vehicles = join_cameras(located, frame)
        tracked = tracker.update(vehicles, frame, np.eye(4)).vehicles
        assert len(tracked) == 1
        ids += tracked.ids.tolist()
        cameras += tracked.cameras.tolist()
    assert cameras[0] == 0
    assert cameras[-1] == 1
    assert set(ids[3:]) == {0}
    assert tracked.velocities_m_s[0] == pytest.approx([-9.0, 0.0], abs=0.5)
    outline_px = box_outlines_px(_LEFT.image_P_velo, tracked.boxes, SIZE_PX)
    np.testing.assert_allclose(tracked.fused.detections.boxes_px, outline_px, atol=40)


def test_a_camera_twice_is_an_error():
    with pytest.raises(UsageError, match="cameras: expected each camera once, found front, front"):
        replace(
            frame_of(road()), camera="front", further_cameras=(CameraImage("front", CALIBRATION),)
        )
