"""New scores, one detection for each object, and what each was made of: by hand."""

from dataclasses import replace

import numpy as np
import pytest

from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.rescoring import Fusion
from perception.detection.fusion.score_calibration import BetaCalibration, FusionCalibration
from perception.detection.suppression import suppress
from perception.errors import ModelError
from perception.types import MODALITIES
from tests.detection.fusion.scenes import SIZE_PX, clumped_scene, detections

HALF_OF_ALL = np.full((3, 3), 0.5)


def test_a_box_gets_the_mean_of_its_combinations(fusion_file):
    modality_detections = {
        "rgb": detections([[100, 100, 200, 200]], [0.8]),
        "dm": detections([[110, 100, 210, 200], [95, 100, 195, 200]], [0.6, 0.2]),
    }
    scene = DetectedScene(modality_detections, SIZE_PX)
    rescored = Fusion(fusion_file(weights=HALF_OF_ALL)).rescore(scene)
    assert rescored.tri_boxes.tolist() == [[0, 0, -1], [0, 1, -1]]
    np.testing.assert_allclose(rescored.detections.scores, [0.6, 0.7, 0.5], atol=1e-6)
    assert rescored.best.tolist() == [0, 0, 1]


def test_one_detection_stays_of_each_neighbourhood(fusion_file):
    modality_detections = {
        "rgb": detections([[100, 100, 200, 200], [600, 100, 700, 200]], [0.8, 0.3]),
        "dm": detections([[110, 100, 210, 200]], [0.9]),
        "rm": detections([[900, 100, 950, 150]], [0.5]),
    }
    fused = Fusion(fusion_file()).fuse(DetectedScene(modality_detections, SIZE_PX))
    np.testing.assert_allclose(fused.detections.scores, [0.9, 0.5, 0.3], atol=1e-6)
    assert fused.detections.boxes_px[:, 0].tolist() == [110, 900, 600]
    assert fused.source_indices.tolist() == [[0, 0, -1], [-1, -1, 0], [1, -1, -1]]
    assert fused.dominant_modality.tolist() == [1, 2, 0]
    assert fused.detections.types.tolist() == ["Car"] * 3


def test_the_default_blends_matched_boxes_by_their_scores(fusion_file):
    modality_detections = {
        "rgb": detections([[100, 100, 200, 200]], [0.8]),
        "dm": detections([[110, 100, 210, 200]], [0.6]),
        "rm": detections([[155, 100, 255, 200]], [0.3]),  # overlaps by 0.29: not the same
    }
    fused = Fusion(fusion_file("default")).fuse(DetectedScene(modality_detections, SIZE_PX))
    # Weights 1 / 0.2² and 0.7 / 0.4².
    left = (25 * 100 + 4.375 * 110) / 29.375
    np.testing.assert_allclose(fused.detections.boxes_px[0], [left, 100, left + 100, 200])
    assert fused.detections.boxes_px[1].tolist() == [155, 100, 255, 200]
    assert fused.dominant_modality.tolist() == [0, 2]


def test_the_thesis_keeps_the_best_box_as_it_is(fusion_file):
    modality_detections = {
        "rgb": detections([[100, 100, 200, 200]], [0.8]),
        "dm": detections([[110, 100, 210, 200]], [0.6]),
    }
    fused = Fusion(fusion_file("features")).fuse(DetectedScene(modality_detections, SIZE_PX))
    assert fused.detections.boxes_px.tolist() == [[100, 100, 200, 200]]


def test_classes_do_not_suppress_each_other(fusion_file):
    cars = detections([[100, 100, 200, 200], [600, 100, 700, 200]], [0.6, 0.3])
    vans = detections([[105, 100, 205, 200]], [0.7], "Van")
    fused = Fusion(fusion_file()).fuse(DetectedScene({"rgb": cars.joined(vans)}, SIZE_PX))
    assert fused.detections.types.tolist() == ["Van", "Car", "Car"]
    assert fused.source_indices.tolist() == [[2, -1, -1], [0, -1, -1], [1, -1, -1]]


def test_scores_become_probabilities_in_their_order(fusion_file):
    scene = clumped_scene(0)
    plain = Fusion(fusion_file()).fuse(scene).detections
    curved = Fusion(fusion_file(calibration="2.0,0.5,-1.0")).fuse(scene).detections
    np.testing.assert_array_equal(curved.boxes_px, plain.boxes_px)
    assert (np.diff(curved.scores) <= 0).all()
    logit = 2 * np.log(plain.scores) - 0.5 * np.log(1 - plain.scores) - 1
    np.testing.assert_allclose(curved.scores, 1 / (1 + np.exp(-logit)), atol=1e-9)


def test_a_detection_exists_by_its_score_and_what_was_searched(fusion_file):
    fusion = Fusion(fusion_file("default", calibration="2.0,0.5,-1.0"))
    scene = clumped_scene(0)
    for searched, offset in ((scene, 0.5), (scene.without("rgb"), 1.2)):
        fused = fusion.fuse(searched)
        assert set(fused.detections.types.tolist()) == {"Car"}
        odds = [one / (1 - one) for one in (fused.existence, fused.detections.scores)]
        np.testing.assert_allclose(odds[0] / odds[1], np.exp(offset), rtol=1e-4)


@pytest.mark.parametrize("left", MODALITIES)
def test_a_view_alone_keeps_its_boxes_and_their_order(fusion_file, left):
    scene = clumped_scene(1)
    found = scene.modality_detections[left]
    found = found[suppress(found, 0.5)]
    alone = replace(scene, modality_detections={left: found})
    curves = f"1.0,1.0,0.0 {left}=1.0,1.0,-1.0"
    fused = Fusion(fusion_file("default", HALF_OF_ALL, calibration=curves)).fuse(alone)
    np.testing.assert_array_equal(fused.detections.boxes_px, found.boxes_px)
    odds = found.scores / (1 - found.scores) / np.e
    np.testing.assert_allclose(fused.detections.scores, odds / (1 + odds), atol=1e-9)


def test_curves_are_written_and_read_as_they_are():
    curves = FusionCalibration(
        BetaCalibration(0.5, 2.0, 0.1),
        {"rgb": BetaCalibration(), "rm": BetaCalibration(3.0, 0.0, -1e-7)},
    )
    assert FusionCalibration.parse(str(curves)) == curves
    assert FusionCalibration.parse("1.0,1.0,0.0") == FusionCalibration()
    # Of the fusion, of rgb, of dm, whose curve is not known, of rm.
    found = curves.probabilities(np.full(4, 0.5), np.array(["rgb+dm:Car", "rgb", "dm", "rm"]))
    first = (2 - 0.5) * np.log(2) + 0.1
    np.testing.assert_allclose(found, 1 / (1 + np.exp([-first, 0, 0, 3 * np.log(2) + 1e-7])))


def test_a_class_may_have_its_own_curve():
    curves = FusionCalibration(named={"Car": BetaCalibration(1.0, 1.0, -1.0)})
    found = curves.probabilities(np.full(3, 0.5), np.array(["rgb+dm:Car", "rgb+dm:Van", "rgb"]))
    np.testing.assert_allclose(found, [1 / (1 + np.e), 0.5, 0.5])


def test_a_set_of_modalities_may_have_its_own_curve(fusion_file):
    curves = "1.0,1.0,0.0 Car=1.0,1.0,-1.0 dm+rm:Car=1.0,1.0,-2.0"
    scene = clumped_scene(2)
    for lost, offset in (((), -1), (("rgb",), -2)):
        remaining = scene.without(*lost)
        plain = Fusion(fusion_file("default", HALF_OF_ALL)).fuse(remaining).detections
        found = Fusion(fusion_file("default", HALF_OF_ALL, calibration=curves)).fuse(remaining)
        odds = plain.scores / (1 - plain.scores) * np.exp(offset)
        np.testing.assert_allclose(found.detections.scores, odds / (1 + odds), atol=1e-9)


@pytest.mark.parametrize("variant", ["scores", "features", "default"])
@pytest.mark.parametrize("lost", [(), ("rgb",), ("dm", "rm"), ("rgb", "dm"), ("rgb", "dm", "rm")])
def test_any_modality_may_be_missing(fusion_file, variant, lost):
    scene = clumped_scene(2).without(*lost)
    fused = Fusion(fusion_file(variant)).fuse(scene)
    assert bool(len(fused)) == (len(lost) < 3)
    for column, name in enumerate(("rgb", "dm", "rm")):
        assert name in scene.modality_detections or (fused.source_indices[:, column] == -1).all()
    rows = np.arange(len(fused))
    assert (fused.source_indices[rows, fused.dominant_modality] >= 0).all()


def test_no_detections_fuse_to_no_detections(fusion_file):
    fused = Fusion(fusion_file()).fuse(
        DetectedScene({"rgb": detections([]), "dm": detections([])}, SIZE_PX)
    )
    assert len(fused) == 0


def test_boxes_without_area_do_no_harm(fusion_file):
    modality_detections = {"rgb": detections([[5, 5, 5, 9]]), "dm": detections([[5, 5, 5, 9]])}
    fused = Fusion(fusion_file("default")).fuse(DetectedScene(modality_detections, SIZE_PX))
    assert np.isfinite(fused.detections.boxes_px).all()


@pytest.mark.parametrize(
    ("metadata", "expected", "found"),
    [
        ({"kind": "detector"}, "kind fusion", "detector"),
        (
            {"features": "score_rgb,score_rm,score_dm"},
            "a variant scores, features, default with its features in their order",
            "features with 23 inputs",
        ),
        ({"calibration": "one"}, "calibration of three numbers a curve", "one"),
        ({"calibration": "-1,0,0"}, "calibration of three numbers a curve", "-1,0,0"),
    ],
)
def test_files_of_other_networks(fusion_file, metadata, expected, found):
    file = fusion_file(**metadata)
    with pytest.raises(ModelError) as error:
        Fusion(file)
    assert (error.value.where, error.value.expected) == (file.name, expected)
    assert error.value.found == found
