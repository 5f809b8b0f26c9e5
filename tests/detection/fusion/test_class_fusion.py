"""Detectors of different classes: what the fusion network knows is fused, the rest keeps its scores."""

from dataclasses import replace

import numpy as np
import pytest

from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.fusion.class_fusion import (
    ClassFusion,
    ClassGroup,
    class_groups,
    detector_fingerprints,
    fusion_of,
)
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.nms_fusion import NmsFusion
from perception.detection.fusion.rescoring import Fusion
from perception.types import MODALITIES, Detections
from tests.detection.bright_cells import bright_cells

SIZE_PX = (200, 100)


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


def test_classes_are_grouped_by_the_detectors_that_know_them(open_detectors):
    detectors = open_detectors(rgb="Car,Cyclist,Van", dm="Car,Van", rm="Car")
    assert class_groups(("Car", "Van"), detectors) == (
        ClassGroup(("Car",), ("rgb", "dm", "rm"), is_fused=True),
        ClassGroup(("Cyclist",), ("rgb",), is_fused=False),
        ClassGroup(("Van",), ("rgb", "dm"), is_fused=True),
    )


def test_detectors_of_the_classes_of_the_network_need_nothing_else(
    open_detectors, doubling, caplog
):
    assert fusion_of(doubling, open_detectors(rgb="Car,Van", dm="Van,Car")) is doubling
    assert caplog.records == []


def test_other_classes_keep_the_scores_of_their_detectors(open_detectors, doubling, caplog):
    fusion = fusion_of(doubling, open_detectors(rgb="Car,Cyclist", dm="Car", rm="Cyclist,Car"))
    assert isinstance(fusion, ClassFusion)
    assert len(caplog.records) == 1
    found = {
        "rgb": detections((0, 0.4, "Cyclist"), (50, 0.2, "Car"), (4, 0.1, "Cyclist")),
        "dm": detections((52, 0.3, "Car")),
        "rm": detections((52, 0.1, "Car"), (2, 0.5, "Cyclist")),
    }
    fused = fusion.fuse(DetectedScene(found, SIZE_PX))
    assert fused.detections.types.tolist() == ["Car", "Cyclist"]
    np.testing.assert_allclose(fused.detections.scores, [0.6, 0.5], rtol=1e-6)
    # Rows of the detections as they were given, not of one class.
    np.testing.assert_array_equal(fused.source_indices, [[1, 0, 0], [0, -1, 1]])
    np.testing.assert_array_equal(fused.dominant_modality, [1, 2])


def test_each_class_is_fused_as_without_the_others(open_detectors, doubling):
    fusion = fusion_of(doubling, open_detectors(rgb="Car,Cyclist", dm="Car", rm="Car"))
    cars = {
        "rgb": detections((50, 0.2, "Car"), (90, 0.1, "Car")),
        "dm": detections((52, 0.3, "Car")),
        "rm": detections(),
    }
    mixed = cars | {"rgb": cars["rgb"].joined(detections((0, 0.05, "Cyclist")))}
    alone, together = (
        doubling.fuse(DetectedScene(cars, SIZE_PX)),
        fusion.fuse(DetectedScene(mixed, SIZE_PX)),
    )
    np.testing.assert_array_equal(together.detections.boxes_px[:-1], alone.detections.boxes_px)
    np.testing.assert_array_equal(together.detections.scores[:-1], alone.detections.scores)
    np.testing.assert_array_equal(together.source_indices[:-1], alone.source_indices)


def test_a_detector_that_had_no_input_is_left_out(open_detectors, doubling):
    fusion = fusion_of(doubling, open_detectors(rgb="Car,Cyclist", dm="Car", rm="Car"))
    fused = fusion.fuse(DetectedScene({"dm": detections((52, 0.3, "Car"))}, SIZE_PX))
    np.testing.assert_array_equal(fused.source_indices, [[-1, 0, -1]])
    assert len(fusion.fuse(DetectedScene({}, SIZE_PX))) == 0


def test_a_single_detector_of_ones_own_is_not_rescored(open_detectors, fusion_file, caplog):
    detectors = open_detectors(rgb="Car,Cyclist")
    others = ", ".join(f"{name} 0123456789abcdef" for name in MODALITIES)
    assert isinstance(fusion_of(Fusion(fusion_file(detectors=others)), detectors), NmsFusion)
    assert [record.args for record in caplog.records] == [("rgb.onnx", "Car, Cyclist")]
    fitted = Fusion(fusion_file(detectors=detector_fingerprints(detectors)))
    assert isinstance(fusion_of(fitted, detectors), ClassFusion)


def test_scene_of_some_classes_keeps_their_depths(open_detectors):

    found = detections((0, 0.4, "Cyclist"), (50, 0.2, "Car"))
    scene = DetectedScene({"dm": found}, SIZE_PX, {"dm": np.array([[5.0, 6], [7, 8]])})
    cars = scene.of_classes(["Car"])
    assert cars.modality_detections["dm"].types.tolist() == ["Car"]
    np.testing.assert_array_equal(cars.depths_m["dm"], [[7, 8]])
    assert replace(cars, depths_m={}).of_classes([]).merged.detections.types.tolist() == []
