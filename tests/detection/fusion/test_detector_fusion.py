"""Detectors of different classes: what the fusion network knows is fused, the rest keeps its scores."""

import numpy as np
import pytest

from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.detector_fusion import detector_fingerprints, fusion_of
from perception.detection.fusion.nms_fusion import NmsFusion
from perception.detection.fusion.rescoring import Fusion
from perception.types import MODALITIES, Detections, ModalityDetections
from tests.detection.bright_cells import bright_cells

SIZE_PX = (200, 100)
CLASSES = {"rgb": ("Car", "Cyclist"), "dm": ("Car",), "rm": ("Cyclist", "Car")}


def detections(*rows: tuple[float, float, str]) -> Detections:
    """Return boxes 20 pixels wide at columns, with scores and classes."""
    boxes_px = np.array([(x, 0, x + 20, 20) for x, _, _ in rows], float).reshape(-1, 4)
    scores, types = [row[1] for row in rows], [row[2] for row in rows]
    return Detections(boxes_px, np.array(scores), np.array(types, np.str_))


@pytest.fixture
def open_detectors(tmp_path):
    """Return a function that opens detectors of classes by modality."""

    def open_all(**classes: str) -> dict[str, ModalityDetector]:
        opened = {}
        for modality, names in classes.items():
            path = tmp_path / f"{modality}.onnx"
            path.write_bytes(bright_cells(modality, names))
            opened[modality] = ModalityDetector(path, threads=1)
        return opened

    return open_all


@pytest.fixture
def doubling(fusion_file) -> Fusion:
    """Return a fusion for cars and vans that doubles every score."""
    return Fusion(fusion_file(weights=2 * np.eye(3), classes="Car,Van"))


def scene_of(found: ModalityDetections, **class_names: tuple[str, ...]) -> DetectedScene:
    return DetectedScene(found, SIZE_PX, class_names=CLASSES | class_names)


def test_detectors_of_the_classes_of_the_network_need_no_other_fusion(
    open_detectors, doubling, caplog
):
    assert fusion_of(doubling, open_detectors(rgb="Car,Van", dm="Van,Car")) is doubling
    assert caplog.records == []


def test_classes_that_the_network_does_not_know_are_named(open_detectors, doubling, caplog):
    fusion_of(doubling, open_detectors(rgb="Car,Cyclist", dm="Car", rm="Cyclist,Bus"))
    assert [record.args for record in caplog.records] == [(doubling.name, "Cyclist, Bus")]


def test_other_classes_keep_the_scores_of_their_detectors(doubling):
    found = {
        "rgb": detections((0, 0.4, "Cyclist"), (50, 0.2, "Car"), (4, 0.1, "Cyclist")),
        "dm": detections((52, 0.3, "Car")),
        "rm": detections((52, 0.1, "Car"), (2, 0.5, "Cyclist")),
    }
    fused = doubling.fuse(scene_of(found))
    assert fused.detections.types.tolist() == ["Car", "Cyclist"]
    np.testing.assert_allclose(fused.detections.scores, [0.6, 0.5], rtol=1e-6)
    np.testing.assert_array_equal(fused.source_indices, [[1, 0, 0], [0, -1, 1]])
    np.testing.assert_array_equal(fused.dominant_modality, [1, 2])


def test_each_class_takes_the_curve_of_what_it_comes_from(fusion_file):
    curves = "1.0,1.0,1.0 rgb=1.0,1.0,-1.0 dm=1.0,1.0,-2.0"
    fusion = Fusion(fusion_file("default", calibration=curves))
    found = {
        "rgb": detections((50, 0.5, "Car"), (0, 0.5, "Cyclist")),
        "dm": detections((100, 0.5, "Bus")),
        "rm": detections(),
    }
    fused = fusion.fuse(scene_of(found, dm=("Car", "Bus"), rm=("Car",)))
    assert fused.detections.types.tolist() == ["Car", "Cyclist", "Bus"]
    assert fused.dominant_modality.tolist() == [0, 0, 1]
    np.testing.assert_allclose(fused.detections.scores, 1 / (1 + np.exp([-1, 1, 2])), atol=1e-6)


def test_a_class_of_a_single_modality_is_not_fused(fusion_file):
    fusion = Fusion(fusion_file("default", classes="Car,Cyclist"))
    scene = scene_of({"rgb": detections(), "dm": detections()})
    types = np.array(["Car", "Cyclist", "Bus"])
    assert scene.searched(types).tolist() == [[1, 1, 0], [1, 0, 0], [0, 0, 0]]
    assert fusion.is_fused(scene, types).tolist() == [True, False, False]


def test_a_detector_that_had_no_input_is_left_out(doubling):
    fused = doubling.fuse(scene_of({"dm": detections((52, 0.3, "Car"))}))
    np.testing.assert_array_equal(fused.source_indices, [[-1, 0, -1]])
    assert len(doubling.fuse(scene_of({}))) == 0


def test_a_single_detector_of_ones_own_is_not_rescored(open_detectors, fusion_file, caplog):
    detectors = open_detectors(rgb="Car,Cyclist")
    others = ", ".join(f"{name} 0123456789abcdef" for name in MODALITIES)
    assert isinstance(fusion_of(Fusion(fusion_file(detectors=others)), detectors), NmsFusion)
    assert [record.args for record in caplog.records] == [("rgb.onnx", "Car, Cyclist")]
    fitted = Fusion(fusion_file(detectors=detector_fingerprints(detectors)))
    assert fusion_of(fitted, detectors) is fitted
