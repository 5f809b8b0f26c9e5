"""Measures of detectors on labels that can be counted by eye."""

from dataclasses import replace

import numpy as np
import pytest

from perception.errors import UsageError
from perception.evaluation.detection.class_precision import ClassPrecision, PrecisionMetrics
from perception.evaluation.detection.config import CorruptionLevels, PrecisionConfig
from perception.evaluation.detection.detector_measure import DetectorMeasure, FrameDetections
from perception.evaluation.detection.fusion_measure import ClassFusionReport, FusionRow
from perception.evaluation.detection.protocol import KITTI_CLASSES, kitti_class
from perception.evaluation.detection.robustness_measure import RobustnessReport
from perception.types import Boxes3D, Detections, Labels
from tests.faults import fault

BOXES_PX = np.array([[0.0, 100, 100, 150], [200, 100, 300, 150]])
CAR = KITTI_CLASSES[:1]


def labels_of(boxes_px: np.ndarray) -> Labels:
    count = len(boxes_px)
    return Labels(
        boxes_velo=Boxes3D(np.zeros((count, 3)), np.ones((count, 3)), np.zeros(count)),
        boxes_px=boxes_px,
        types=np.full(count, "Car"),
        track_ids=np.full(count, -1),
        truncation=np.zeros(count),
        occlusion=np.zeros(count, np.int64),
        dont_care_px=np.zeros((0, 4)),
    )


def detected(boxes_px: np.ndarray, scores: list[float], proposals_px=None) -> FrameDetections:
    found = Detections(boxes_px, np.array(scores), np.full(len(scores), "Car"))
    return FrameDetections(found, {"maps": 0.002, "network": 0.003}, proposals_px)


def test_two_frames_with_one_missed_car():
    measure = DetectorMeasure(CAR, PrecisionConfig((0.7,)), title="test")
    measure.update(detected(BOXES_PX, [0.9, 0.8]), labels_of(BOXES_PX))
    measure.update(detected(BOXES_PX[:1], [0.7]), labels_of(BOXES_PX))
    document = measure.compute().to_json()
    easy = document["classes"]["Car"]["0.7"]["easy"]
    assert (easy["objects"], easy["found"], easy["recall_percent"]) == (4, 3, 75.0)
    # Precision is 1 at recall 0, 1/40 and 2/40.
    assert easy["ap_r40_percent"] == pytest.approx(100 * 2 / 40)
    assert easy["max_ap_r40_percent"] == pytest.approx(100 * 3 / 40)
    assert easy["proposal_recall_percent"] is None
    assert document["ms_per_frame"] == {"p50": pytest.approx(5.0), "p99": pytest.approx(5.0)}
    assert document["proposals_per_frame"] is None


def test_a_class_without_labels_or_detections_is_noted():
    classes = (KITTI_CLASSES[0], kitti_class("Tram"), kitti_class("Van"))
    measure = DetectorMeasure(classes, PrecisionConfig((0.7,)), title="test")
    labels = replace(labels_of(BOXES_PX), types=np.array(["Car", "Van"]))
    measure.update(detected(BOXES_PX, [0.9, 0.8]), labels)
    _, table = measure.compute().tables()
    assert [note.partition(":")[::2] for note in table.notes[:2]] == [
        ("Tram", " no labelled object of this class, so it has no metrics."),
        ("Van", " nothing detected, so it has no metrics."),
    ]


def test_proposals_have_a_recall_of_their_own():
    measure = DetectorMeasure(CAR, PrecisionConfig((0.7,)), title="test")
    measure.update(detected(BOXES_PX[:1], [0.9], BOXES_PX), labels_of(BOXES_PX))
    report = measure.compute()
    document = report.to_json()
    easy = document["classes"]["Car"]["0.7"]["easy"]
    assert (easy["found"], easy["proposal_recall_percent"]) == (1, 100.0)
    assert document["proposals_per_frame"] == 2.0
    _, table = report.tables()
    assert [column.name for column in table.columns] == [
        *("objects", "proposal recall [%]", "found", "recall [%]", "AP R40 [%]", "max AP [%]"),
    ]


@pytest.mark.parametrize(
    ("values", "where", "found"),
    [
        ({"iou": (0.7, 1.0)}, "--iou", "1"),
        ({"recall_points": (40, 20)}, "--recall-points", "40,20"),
        ({"recall_points": ()}, "--recall-points", "none"),
        ({"bootstrap": -3}, "--bootstrap", "-3"),
    ],
)
def test_a_metric_out_of_range(values, where, found):
    with pytest.raises(UsageError) as error:
        PrecisionConfig(**values)
    assert (error.value.where, error.value.found) == (where, found)


def test_levels_that_do_not_rise():
    rising = "levels that rise from above 0"
    with fault(UsageError, where="--levels.shift", expected=rising, found="4, 2"):
        CorruptionLevels(shift=(4, 2))
    with fault(UsageError, where="--levels.point-dropout", expected=rising, found="0, 0.5"):
        CorruptionLevels(point_dropout=(0, 0.5))
    some = "levels of one corruption or more"
    with fault(UsageError, where="--levels", expected=some, found="none"):
        CorruptionLevels((), (), (), ())


def test_curves_over_the_levels_of_a_corruption():
    def row(**objects: int) -> dict[str, ClassPrecision]:
        found = {n: PrecisionMetrics(count, (40,), None) for n, count in objects.items()}
        return {n: ClassPrecision("Car", {0.7: {"moderate": one}}) for n, one in found.items()}

    # Nothing is detected: 0 %, and of no object unknown.
    levels = {0.0: row(color=0, fused=3), 2.0: row(color=3, fused=3)}
    report = RobustnessReport(PrecisionConfig(), {"shift [pixels]": levels})
    (panel,) = report.panels()
    assert (panel.title, panel.x_label, panel.y_label) == (
        "",
        "shift [pixels]",
        "AP R40 [%], moderate",
    )
    color, fused = panel.curves
    assert (color.name, fused.name, color.is_emphasised, fused.is_emphasised) == (
        "color", "fused", False, True,
    )  # fmt: skip
    assert color.x == fused.x == panel.x_ticks == [0.0, 2.0]
    np.testing.assert_array_equal([color.y, fused.y], [[np.nan, 0], [0, 0]])
    (table,) = report.tables()
    assert table.title == "shift [pixels]: AP R40 [%], moderate"
    assert list(table.rows) == ["0", "2"]


def test_tables_of_a_fusion_name_metric_and_iou():
    nothing = {level: PrecisionMetrics(3, (40,), None) for level in ("easy", "moderate", "hard")}
    single = FusionRow(ClassPrecision("Car", {0.5: nothing}))
    joined = FusionRow(single.precision, (single.precision, single.precision))
    report = ClassFusionReport({"color": single, "fused": joined}, {"rgb+dm": joined}, {}, {})
    first, gain, missing, missing_gain = report.tables()
    assert first.title == "AP R40 [%], IoU over 0.5"
    assert gain.title == "Gain over the best modality [points], IoU over 0.5"
    assert missing.title == (
        "Missing modalities: AP R40 [%] of Trifuse's fusion of the remaining, IoU over 0.5"
    )
    assert missing_gain.title == (
        "Missing modalities: gain over the best remaining modality [points], IoU over 0.5"
    )
    assert list(first.rows) == ["color", "fused", "perfect detector"]
    assert list(gain.rows) == ["fused"]
    assert list(missing.rows) == list(missing_gain.rows) == ["color + depth"]
    assert missing_gain.notes[0] == "Objects: 3 easy, 3 moderate, 3 hard"
