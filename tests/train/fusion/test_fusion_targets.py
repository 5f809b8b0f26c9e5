"""Targets by hand: the overlap with the best label, and what is neither right nor wrong."""

import numpy as np
import pytest

from data.detections.detected_frames import DetectedFrames
from perception.detection.fusion.detected_scene import DetectedScene
from perception.errors import UsageError
from perception.evaluation.detection.box_rows import TrueBoxes
from tests.detection.fusion.scenes import detections
from tests.faults import fault
from train.fusion.targets import box_targets, fusion_rows, jitter_scores, mismatch_views

SIZE_PX = (1000, 300)


def truth_of(*rows) -> TrueBoxes:
    types = np.array([name for name, _ in rows], np.str_)
    boxes_px = np.array([box for _, box in rows], float).reshape(-1, 4)
    zeros = np.zeros(len(rows))
    return TrueBoxes(zeros.astype(int), types, zeros - 10, boxes_px, zeros, zeros)


def test_overlap_with_the_best_label_of_the_type():
    found = detections([[0, 0, 20, 10], [500, 0, 510, 10]])
    truth = truth_of(
        ("Car", [10, 0, 30, 10]), ("Car", [0, 0, 20, 20]), ("Pedestrian", [0, 0, 20, 10])
    )
    targets = box_targets(found, truth)
    np.testing.assert_allclose(targets.ious, [0.5, 0])
    assert targets.is_used.tolist() == [True, True]


def test_vans_and_unlabelled_regions_are_not_used():
    boxes = [[0, 0, 20, 10], [100, 0, 120, 10], [200, 0, 220, 10], [300, 0, 320, 10]]
    truth = truth_of(
        ("Van", [0, 0, 20, 10]),
        ("DontCare", [90, 0, 200, 50]),
        ("Car", [200, 0, 220, 10]),
        ("DontCare", [190, 0, 310, 50]),  # holds the third, which is a car, and half of the fourth
    )
    targets = box_targets(detections(boxes), truth)
    assert targets.ious.tolist() == [0, 0, 1, 0]
    assert targets.is_used.tolist() == [False, False, True, True]


def frames() -> DetectedFrames:
    modality_detections = {
        "rgb": detections([[0, 0, 20, 10]], [0.9]),
        "dm": detections([[0, 0, 10, 10]], [0.8]),
        "rm": detections([]),
    }
    truth = truth_of(("Car", [0, 0, 20, 10]))
    return DetectedFrames((DetectedScene(modality_detections, SIZE_PX),), truth)


def test_the_thesis_asks_zero_of_what_is_not_there():
    rows = fusion_rows(frames(), "scores")
    np.testing.assert_allclose(rows.features, [[0.9, 0.8, 0]])
    assert rows.targets.tolist() == [[1, 0.5, 0]]
    assert rows.weights.tolist() == [[1, 1, 1]]


def test_boxes_of_a_match_share_a_target_and_a_weight():
    rows = fusion_rows(frames(), "default")
    np.testing.assert_allclose(rows.features[0], [0.9, 0.8, 0, 1, 1, 1, 1, 0, 0, 0, 0])
    # Blended, the box is 10 + 10 / 1.175 pixels wide.
    assert rows.targets[0].tolist() == [1, 1, 1]
    assert rows.weights[0].tolist() == [0.5, 0.5, 0]


def test_the_default_learns_every_set_that_may_remain():
    rows = fusion_rows(frames(), "default")
    car = [1, 0, 0, 0, 0]
    expected = [
        [0.9, 0.8, 0, 1, 1, 1, *car],
        [0.9, 0.8, 0, 1, 1, 0, *car],
        [0.9, 0, 0, 1, 0, 1, *car],
        [0, 0.8, 0, 0, 1, 1, *car],
    ]
    np.testing.assert_allclose(rows.features, expected)
    # By itself the depth map's box covers half of the car: more than 0.3, not more than 0.5.
    np.testing.assert_allclose(rows.targets[:, 0], [1, 1, 1, 1 / 3])


def test_the_default_asks_which_thresholds_are_exceeded():
    boxes = [[0, 0, 20, 10], [100, 0, 120, 10], [200, 0, 220, 10]]
    labels = [("Car", [0, 0, 20, 9]), ("Car", [100, 0, 120, 6]), ("Van", [200, 0, 220, 10])]
    scene = DetectedScene({"rgb": detections(boxes), "rm": detections([])}, SIZE_PX)
    rows = fusion_rows(DetectedFrames((scene,), truth_of(*labels)), "default")
    np.testing.assert_allclose(rows.targets[:, 0], [1, 2 / 3, 0])
    assert rows.weights[:, 0].tolist() == [1, 1, 0]  # a van is no wrong car


def test_the_default_learns_from_all_frames_again_with_corrupted_detections():
    two = frames().without("rm")
    once = fusion_rows(two, "default")
    thrice = fusion_rows(two, "default", corrupted_copies=2)
    assert len(thrice) == 3 * len(once)
    assert (thrice.features[1:, :2] != once.features[:, :2]).all()
    np.testing.assert_array_equal(thrice.features[1:, 2:], once.features[[0, 0], 2:])


def test_a_mismatched_modality_has_the_boxes_of_another_frame():
    scenes = tuple(
        DetectedScene(
            {name: detections([[k, 0, k + 20, 10]], [0.5]) for name in ("rgb", "dm", "rm")}, SIZE_PX
        )
        for k in range(400)
    )
    many = DetectedFrames(scenes, truth_of()[[]])

    def shares(one: DetectedFrames) -> dict[str, float]:
        lefts = {
            name: [
                scene.modality_detections[name].boxes_px[0, 0]
                for scene in mismatch_views(one, 1).scenes
            ]
            for name in one.modalities
        }
        return {name: float(np.mean(found != np.arange(400))) for name, found in lefts.items()}

    assert shares(many) == pytest.approx({"rgb": 0, "dm": 0.3, "rm": 0.6}, abs=0.06)
    # The first of those that are there is taken for right.
    assert shares(many.without("rgb")) == pytest.approx({"dm": 0, "rm": 0.6}, abs=0.06)
    again = mismatch_views(many, 1).scenes[7].modality_detections
    assert again == mismatch_views(many, 1).scenes[7].modality_detections


def test_jittered_scores_keep_their_order():
    scene = DetectedScene({"rgb": detections([[0, 0, 20, 10]] * 5)}, SIZE_PX)
    one = DetectedFrames((scene,) * 40, truth_of()[[]])
    scores = np.array(
        [other.modality_detections["rgb"].scores for other in jitter_scores(one, 3).scenes]
    )
    assert (np.diff(scores, axis=1) < 0).all()
    # A logit of 0 is shifted only; one of ln 9 is stretched by up to 15 %, too.
    logits = np.log(scores / (1 - scores))
    assert np.std(logits[:, 2]) == pytest.approx(0.9, rel=0.3)
    assert (abs((logits[:, 0] - logits[:, 2]) / np.log(9) - 1) <= 0.15).all()
    again = jitter_scores(one, 3).scenes[7].modality_detections["rgb"].scores
    np.testing.assert_array_equal(again, scores[7])


def test_all_combinations_are_counted_and_no_more_than_fit_into_memory(monkeypatch):
    boxes = [[k, 0, k + 20, 10] for k in range(6)]
    scene = DetectedScene({name: detections(boxes) for name in ("rgb", "dm", "rm")}, SIZE_PX)
    crowd = DetectedFrames((scene,), truth_of(("Car", [0, 0, 20, 10])))
    assert len(fusion_rows(crowd, "features")) < 6**3
    assert len(fusion_rows(crowd, "features", max_partners=0)) == 6**3
    monkeypatch.setattr("train.fusion.targets._MAX_ROWS", 100)
    with fault(UsageError, "fusion", "at most 100", "more", "--model.max_partners"):
        fusion_rows(crowd, "features", max_partners=0)


def test_frames_without_detections_give_no_sample():
    scene = DetectedScene({"rgb": detections([])}, SIZE_PX)
    empty = DetectedFrames((scene,), truth_of(("Car", [0, 0, 20, 10])))
    with fault(UsageError, expected="frames with detections", found="none"):
        fusion_rows(empty, "features")
