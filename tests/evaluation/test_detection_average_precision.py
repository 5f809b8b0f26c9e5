"""The detection measure on boxes that can be counted by eye, and on what cannot be measured."""

import numpy as np
import pytest

from perception.errors import PerceptionError, UsageError
from perception.evaluation.detection.average_precision import (
    PrecisionCurve,
    kitti_average_precision,
    match_detections,
    max_ap,
    resample_precision,
)
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from perception.evaluation.detection.protocol import KITTI_CLASSES, DetectionClass
from perception.types import Detections

CAR = KITTI_CLASSES[:1]


def truths_of(*rows: tuple[int, str, list[float]]) -> TrueBoxes:
    """Return labels that are seen wholly and freely."""
    return TrueBoxes(
        frames=np.array([row[0] for row in rows], int),
        types=np.array([row[1] for row in rows], np.str_),
        alphas_rad=np.zeros(len(rows)),
        boxes_px=np.array([row[2] for row in rows], float).reshape(-1, 4),
        truncation=np.zeros(len(rows)),
        occlusion=np.zeros(len(rows)),
    )


def detections_of(*rows: tuple[int, str, list[float], float]) -> DetectedBoxes:
    return DetectedBoxes(
        frames=np.array([row[0] for row in rows], int),
        types=np.array([row[1] for row in rows], np.str_),
        alphas_rad=np.zeros(len(rows)),
        boxes_px=np.array([row[2] for row in rows], float).reshape(-1, 4),
        scores=np.array([row[3] for row in rows], float),
    )


def box(x: float, width: float = 100, height: float = 50) -> list[float]:
    return [x, 100, x + width, 100 + height]


def easy(truths: TrueBoxes, detections: DetectedBoxes, frames: int) -> PrecisionCurve:
    return kitti_average_precision(pair_boxes(truths, detections, frames), CAR)[CAR[0]]["easy"]


def test_two_cars_of_which_one_is_found_first_and_a_ghost_between():
    truths = truths_of((0, "Car", box(0)), (1, "Car", box(200)))
    detections = detections_of(
        (0, "Car", box(0), 0.9), (0, "Car", box(500), 0.8), (1, "car", box(205), 0.7)
    )
    curve = easy(truths, detections, frames=3)
    assert curve.thresholds.tolist() == [0.9, 0.7]
    assert curve.true_positives.tolist() == [1, 2]
    assert curve.false_positives.tolist() == [0, 1]
    assert curve.false_negatives.tolist() == [1, 0]
    assert curve.precision[:3].tolist() == [1, 2 / 3, 0]
    assert curve.ap(40) == pytest.approx(100 * (2 / 3) / 40)
    assert curve.ap(11) == pytest.approx(100 / 11)


def test_perfect_detection_of_many_is_all():
    truths = truths_of(*((frame, "Car", box(10)) for frame in range(41)))
    detections = detections_of(*((frame, "Car", box(10), frame / 41) for frame in range(41)))
    curve = easy(truths, detections, frames=41)
    assert (curve.ap(11), curve.ap(40), curve.aos(40)) == (100, 100, 100)


def test_an_opposite_heading_is_correct_but_not_similar():
    truths = truths_of((0, "Car", box(0)))
    detections = detections_of((0, "Car", box(0), 1.0))
    opposite = DetectedBoxes(**{**vars(detections), "alphas_rad": np.array([np.pi])})
    curve = easy(truths, opposite, frames=1)
    assert curve.precision[0] == 1
    assert curve.orientation_similarity[0] == pytest.approx(0, abs=1e-12)


def test_one_missing_heading_leaves_all_without():
    truths = truths_of((0, "Car", box(0)), (0, "Pedestrian", box(300)))
    detections = detections_of((0, "Car", box(0), 1.0), (0, "Pedestrian", box(300), 1.0))
    headless = DetectedBoxes(**{**vars(detections), "alphas_rad": np.array([0.0, -10.0])})
    assert easy(truths, headless, frames=1).aos() is None


def test_a_class_without_detections_has_no_metrics():
    truths = truths_of((0, "Car", box(0)), (0, "Cyclist", box(300)))
    detections = detections_of((0, "Cyclist", box(300), 0.5))
    car, pedestrian, cyclist = kitti_average_precision(pair_boxes(truths, detections, 1)).values()
    assert car == pedestrian == {}
    assert cyclist["easy"].true_positives.tolist() == [1]


def test_a_class_without_labels_rests_on_no_truths():
    curve = easy(truths_of((0, "Truck", box(0))), detections_of((0, "Car", box(0), 0.5)), frames=1)
    assert (curve.truths, curve.matches, len(curve.thresholds)) == (0, 0, 0)
    assert curve.ap(40) == 0
    no_labels_at_all = easy(truths_of(), detections_of((0, "Car", box(0), 0.5)), frames=1)
    assert (no_labels_at_all.truths, no_labels_at_all.ap(11)) == (0, 0)


def test_no_labels_and_no_detections_give_no_class():
    metrics = kitti_average_precision(pair_boxes(truths_of(), detections_of(), 0))
    assert list(metrics.values()) == [{}, {}, {}]


def test_any_class_can_be_evaluated():
    tram = DetectionClass("Tram", iou=0.3, neighbours=("Truck",))
    truths = truths_of((0, "Tram", box(0)), (0, "Truck", box(200)))
    detections = detections_of((0, "TRAM", box(50), 0.9), (0, "tram", box(200), 0.8))
    curve = kitti_average_precision(pair_boxes(truths, detections, 1), [tram])[tram]["hard"]
    assert (curve.truths, curve.matches) == (1, 1)
    assert curve.false_positives.tolist() == [0]
    with pytest.raises(UsageError) as error:
        tram.at_iou(1.0)
    assert (error.value.expected, error.value.found) == ("from 0 to below 1", "1")


@pytest.mark.parametrize(
    ("change", "where", "expected", "found"),
    [
        ({"scores": np.array([0.5, np.nan])}, "scores", "finite numbers", "NaN or infinity"),
        ({"boxes_px": np.zeros((2, 3))}, "boxes_px", "shape (2, 4)", "shape (2, 3)"),
        (
            {"frames": np.array([1, 0])},
            "frames",
            "frames from 0 in ascending order",
            "another order",
        ),
        (
            {"frames": np.array([-1, 0])},
            "frames",
            "frames from 0 in ascending order",
            "another order",
        ),
    ],
)
def test_rows_that_cannot_be_measured(change, where, expected, found):
    good = detections_of((0, "Car", box(0), 0.5), (2, "Car", box(0), 0.5))
    with pytest.raises(PerceptionError) as error:
        DetectedBoxes(**{**vars(good), **change})
    assert error.value.where == f"DetectedBoxes.{where}"
    assert (error.value.expected, error.value.found) == (expected, found)


def test_boxes_beyond_the_last_frame():
    beyond = detections_of((2, "Car", box(0), 0.5))
    with pytest.raises(PerceptionError) as error:
        pair_boxes(truths_of(), beyond, frames=2)
    assert (error.value.expected, error.value.found) == ("below 2", "frame 2")


def test_no_resample_without_frames():
    matches = match_detections(pair_boxes(truths_of(), detections_of(), 0))[CAR[0]]
    with pytest.raises(UsageError) as error:
        resample_precision(matches, 5, np.random.default_rng(0))
    assert error.value.found == "5 resamples of 0 frames"


def test_max_ap_is_that_of_a_perfect_detector():
    for count in (0, 1, 7, 18, 40, 41, 100):
        rows = [(frame, "Car", box(0)) for frame in range(count)]
        surely = [(*row, 1 - row[0] / 1000) for row in rows]
        if count:
            curve = easy(truths_of(*rows), detections_of(*surely), frames=count)
            assert max_ap(count, 40) == pytest.approx(curve.ap(40))
            assert max_ap(count, 11) == pytest.approx(curve.ap(11))
    assert max_ap(0) == 0
    assert max_ap(18) == pytest.approx(42.5)
    assert max_ap(100) == 100


def test_detections_of_frames_become_rows():
    one = Detections(np.array([[1.0, 2, 3, 4], [5, 6, 7, 8]]), np.array([0.9, 0.1]), np.array(["Car", "Van"]))  # fmt: skip
    rows = DetectedBoxes.of_frames([Detections.empty(), one, Detections.empty(), one[:1]])
    assert rows.frames.tolist() == [1, 1, 3]
    assert rows.types.tolist() == ["Car", "Van", "Car"]
    assert rows.scores.tolist() == [0.9, 0.1, 0.9]
    assert rows.boxes_px[1].tolist() == [5, 6, 7, 8]
    assert (rows.alphas_rad == -10).all()
    assert len(DetectedBoxes.of_frames([])) == len(DetectedBoxes.of_frames([one[:0]])) == 0
