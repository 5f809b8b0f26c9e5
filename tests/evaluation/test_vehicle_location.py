"""Errors of located vehicles, and their rows, by hand-made numbers."""

from dataclasses import replace

import numpy as np
import pytest

from data.results.kitti_rows import vehicle_rows
from perception.detection.vehicles.locate import locate
from perception.evaluation.vehicle_measure import VehicleMeasure, location_errors
from perception.types import Labels
from tests.known_result import VEHICLES, known_result
from tests.vehicle_scenes import CALIBRATION, FlatRoad, cars, detected, frame_of, road, sides


def test_errors_are_those_that_were_made():
    true = cars((12.0, 2.0, 0.0), (25.0, -3.0, 0.0))
    frame = frame_of(road(), sides(true))
    found = locate(detected(true), frame, FlatRoad())
    moved = replace(
        true, bottom_m=true.bottom_m + np.array([0.3, 0.4, 0]), yaw_rad=true.yaw_rad + 3
    )
    wrong = replace(found, boxes=moved, distances_m=found.distances_m + 0.2)
    errors = location_errors(wrong, detected(true).detections.boxes_px, true, frame.points_velo)
    np.testing.assert_allclose(errors.range_m, np.hypot([12, 25], [2, -3]))
    np.testing.assert_allclose(errors.center_m, 0.5)
    np.testing.assert_allclose(errors.yaw_rad, 3.0)
    np.testing.assert_allclose(errors.axis_rad, np.pi - 3.0)
    np.testing.assert_allclose(errors.distance_m, 0.2, atol=0.1)


@pytest.mark.parametrize(
    ("x_m", "name"),
    [(24.5, "0 to 25 m"), (25.0, "25 to 50 m"), (0.0, "0 to 25 m"), (50.0, "from 50 m")],
)
def test_each_car_is_in_one_range(x_m, name):
    boxes = replace(VEHICLES.boxes[:1], bottom_m=np.array([[x_m, 0.0, -1.7]]))
    labels = Labels(
        boxes, VEHICLES.fused.detections.boxes_px[:1], np.array(["Car"]), np.array([3]),
        np.zeros(1), np.zeros(1, np.int64), np.zeros((0, 4)),
    )  # fmt: skip
    measure = VehicleMeasure(0.5)
    measure.update(known_result(), labels)
    report = measure.compute()
    assert {key: one.detected for key, one in report.location.items() if one.detected} == {name: 1}
    assert report.location[name].center_p50_m == pytest.approx(np.hypot(x_m - 10, 2))
    held = {key: one.boxes for key, one in report.intervals.items()}
    assert held == dict.fromkeys(("Car", name), 1) | {k: 0 for k in held if k not in ("Car", name)}
    assert report.tracking["car"].clear.true_positives == 1
    assert list(report.ground_tracking) == ["Car"]


def test_rows_hold_what_is_known_and_the_formats_words_for_what_is_not():
    true = cars((12.0, 2.0, 0.0), (25.0, -3.0, 0.0), (30.0, 5.0, 0.0))
    found = locate(detected(true), frame_of(road(), sides(true[[0, 2]])), FlatRoad())
    rows = vehicle_rows(4, replace(found, ids=np.array([8, 9, -1])), CALIBRATION)
    assert rows.ids.tolist() == [8, 9]
    assert rows.frames.tolist() == [4, 4]
    assert rows.bottoms_cam_m[0, 2] == pytest.approx(12.0 - 0.27, abs=0.2)
    assert rows.bottoms_cam_m[1].tolist() == [-1000.0] * 3
    assert rows.sizes_hwl_m[1].tolist() == [-1.0] * 3
    assert rows.headings_rad[1] == rows.alphas_rad[1] == -10.0


def test_tracks_on_the_ground_count_all_round_where_all_is_labelled():
    boxes = replace(VEHICLES.boxes[:1], bottom_m=VEHICLES.boxes.bottom_m[:1] * (-1.0, 1.0, 1.0))
    behind = Labels(
        boxes, np.full((1, 4), -1.0), np.array(["Car"]), np.array([3]),
        np.zeros(1), np.full(1, 3), np.zeros((0, 4)),
    )  # fmt: skip
    result = known_result()
    middle = boxes.bottom_m + np.array([0.0, 0.0, 0.5])
    points = np.vstack([result.frame.points_velo, np.column_stack([middle, [0.0]])])
    result = replace(result, frame=replace(result.frame, points_velo=points.astype(np.float32)))
    measure = VehicleMeasure(0.5)
    measure.update(result, behind[:0], behind)
    report = measure.compute()
    clear = report.ground_tracking["Car"].clear
    assert clear.true_positives == 0
    assert clear.false_negatives == 1
    assert "all round to 50 m" in report.tables()[1].title
