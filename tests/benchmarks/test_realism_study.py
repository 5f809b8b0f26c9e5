"""Average precision by distance of networks of others, by hand-made frames."""

import numpy as np
import pytest

from benchmarks.studies.realism import (
    RangedFrame,
    measure_ranges,
    measure_realism,
    realism_panels,
    realism_table,
)
from perception.errors import UsageError
from perception.types import Boxes3D, Detections, Labels
from tests.detection.bright_cells import bright_cells
from tests.faults import fault

FOCAL_PX = 720.0


def box_px(left, distance_m, height_m=1.53):
    height_px = FOCAL_PX * height_m / distance_m
    return [left, 200 - height_px, left + 2 * height_px, 200]


def frame_of(labels, detections):
    """Return a frame of cars: left column and distance of each label and each detection."""
    places = np.array(labels, float).reshape(-1, 2)
    count = len(places)
    truth = Labels(
        boxes_velo=Boxes3D(
            np.column_stack([places[:, 1], np.zeros((count, 2))]),
            np.ones((count, 3)),
            np.zeros(count),
        ),
        boxes_px=np.array([box_px(*one) for one in labels]).reshape(-1, 4),
        types=np.full(count, "Car"),
        track_ids=np.arange(count),
        truncation=np.zeros(count),
        occlusion=np.zeros(count, np.int64),
        dont_care_px=np.zeros((0, 4)),
    )
    boxes_px = np.array([box_px(*one) for one in detections]).reshape(-1, 4)
    found = Detections(boxes_px, np.full(len(boxes_px), 0.9), np.full(len(boxes_px), "Car"))
    return RangedFrame.of(truth, found, FOCAL_PX)


def test_a_detection_is_at_the_distance_of_its_label_else_of_a_car_as_high():
    frame = frame_of([(100, 12.0), (600, 40.0)], [(101, 12.5), (300, 20.0)])
    assert frame.label_distances_m.tolist() == [12.0, 40.0]
    np.testing.assert_allclose(frame.detection_distances_m, [12.0, 20.0])


def test_objects_and_false_positives_count_at_their_distance():
    frame = frame_of([(100, 10.0), (600, 40.0)], [(100, 10.0), (300, 20.0)])
    metrics = measure_ranges([frame] * 50, ["Car"])["Car"]
    assert {name: one.objects for name, one in metrics.items()} == {
        "0 to 15 m": 50,
        "15 to 30 m": 0,
        "30 to 50 m": 50,
        "0 to 50 m": 100,
    }
    assert metrics["0 to 15 m"].ap == 100
    assert np.isnan(metrics["15 to 30 m"].ap)
    assert metrics["30 to 50 m"].ap == 0
    assert metrics["0 to 50 m"].ap == pytest.approx(25, abs=1.5)


def test_few_objects_are_measured_against_a_perfect_detector():
    frame = frame_of([(100, 10.0)], [(100, 10.0)])
    metrics = measure_ranges([frame] * 5, ["Car"])["Car"]
    assert metrics["0 to 15 m"] == (5, 100.0)


def test_only_classes_of_the_network_are_measured():
    frame = frame_of([(100, 10.0)], [])
    assert list(measure_ranges([frame], ["Car", "Van", "Cyclist"])) == ["Car", "Cyclist"]


def test_table_and_panels_hold_every_class_range_and_drive():
    frame = frame_of([(100, 10.0)], [(100, 10.0)])
    metrics = {name: measure_ranges([frame] * 50, ["Car"]) for name in ("synthetic", "real")}
    table = realism_table("Network", metrics).to_json()
    assert table["Car 0 to 15 m"] == {
        "synthetic: objects": 50,
        "synthetic": 100.0,
        "real: objects": 50,
        "real": 100.0,
    }
    assert table["Car 30 to 50 m"]["real"] is None
    (panel,) = realism_panels("Network", metrics)
    assert [curve.name for curve in panel.curves] == ["synthetic", "real"]
    assert panel.curves[0].y[0] == 100


def test_a_network_of_maps_is_none_of_photographs(car_frames, tmp_path):
    file = tmp_path / "maps.onnx"
    file.write_bytes(bright_cells("dm", size=(64, 96)))
    with fault(UsageError, where="--public", expected="detectors in camera images"):
        measure_realism([file], [car_frames])
