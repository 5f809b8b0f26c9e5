"""Detectors of any modalities look at a frame; what they say together is the best box of each place."""

from dataclasses import replace

import numpy as np
import pytest

from perception.detection.detectors.modalities import fill_maps, map_image
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.detectors.multimodal import MultimodalDetector
from perception.detection.fusion.detector_fusion import detector_fingerprints
from perception.detection.fusion.rescoring import Fusion
from perception.errors import ImageError, ModelError, UsageError
from perception.maps.densify import densify
from perception.maps.projection import VIRTUAL_CAMERA, project_frame
from perception.types import MODALITIES, Detections, Frame, FusedDetections
from tests.car_frames import CALIBRATION, SIZE_PX
from tests.detection.bright_cells import bright_cells
from tests.detection.fusion.conftest import weighted_sums


@pytest.fixture(scope="module")
def detectors(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    opened = {}
    for modality in MODALITIES:
        path = folder / f"{modality}.onnx"
        path.write_bytes(bright_cells(modality))
        opened[modality] = ModalityDetector(path, threads=1)
    return opened


@pytest.fixture(scope="module")
def frame():
    """A wall before the camera, its right half bright; the image is bright at the left."""
    y, z = np.meshgrid(np.linspace(-6, 6, 200), np.linspace(-1.5, 1.5, 60))
    bright = np.where(y < 0, 0.9, 0.2)
    wall = np.stack([np.full(y.size, 8.0), y.ravel(), z.ravel(), bright.ravel()], axis=1)
    image = np.zeros((SIZE_PX[1], SIZE_PX[0], 3), np.uint8)
    image[:, :200] = 255
    return Frame(0, 0.0, wall.astype(np.float32), image, calibration=CALIBRATION)


def assert_same(one: Detections, other: Detections):
    np.testing.assert_array_equal(one.boxes_px, other.boxes_px)
    np.testing.assert_array_equal(one.scores, other.scores)


def test_each_detector_sees_what_it_sees_alone(detectors, frame):
    output = MultimodalDetector(detectors).detect(frame)
    dense = densify(project_frame(frame))
    pictures = {"rgb": frame.image} | {name: map_image(dense, name) for name in ("dm", "rm")}
    assert list(output.scene.modality_detections) == list(MODALITIES)
    for modality, picture in pictures.items():
        assert_same(output.scene.modality_detections[modality], detectors[modality].detect(picture))
        assert len(output.scene.modality_detections[modality])
    np.testing.assert_array_equal(output.dense.depth_m, dense.depth_m)
    assert sorted(output.timings_s) == ["dm", "fusion", "maps", "rgb", "rm"]


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_output_does_not_depend_on_the_number_of_workers(detectors, frame, workers):
    expected = MultimodalDetector(detectors).detect(frame).fused
    fused = MultimodalDetector(detectors, workers=workers).detect(frame).fused
    assert_same(fused.detections, expected.detections)
    np.testing.assert_array_equal(fused.source_indices, expected.source_indices)


@pytest.mark.parametrize("names", [("rgb",), ("dm",), ("rgb", "rm"), ("dm", "rm")])
def test_any_of_the_modalities(detectors, frame, names):
    output = MultimodalDetector({name: detectors[name] for name in names}).detect(frame)
    assert tuple(output.scene.modality_detections) == names
    assert (output.dense is None) == (names == ("rgb",))
    columns = [MODALITIES.index(name) for name in names]
    assert set(output.fused.dominant_modality) <= set(columns)


def test_frame_without_an_image(detectors, frame):
    blind = replace(frame, image=None)
    assert list(MultimodalDetector(detectors).detect(blind).scene.modality_detections) == [
        "dm",
        "rm",
    ]
    with pytest.raises(ImageError) as error:
        MultimodalDetector({"rgb": detectors["rgb"]}).detect(blind)
    assert (error.value.expected, error.value.found) == ("a camera image", "none")


def test_image_alone_needs_no_calibration(detectors, frame):
    bare = replace(frame, calibration=None)
    assert list(
        MultimodalDetector({"rgb": detectors["rgb"]}).detect(bare).scene.modality_detections
    ) == ["rgb"]


def test_without_a_calibration_the_map_detectors_use_the_virtual_camera(detectors, frame):
    bare = replace(frame, calibration=None)
    output = MultimodalDetector(detectors).detect(bare)
    assert list(output.scene.modality_detections) == ["dm", "rm"]
    assert output.dense.depth_m.shape == VIRTUAL_CAMERA.image_size_px[::-1]
    seen = replace(frame, image=None, calibration=VIRTUAL_CAMERA)
    assert_same(
        output.fused.detections, MultimodalDetector(detectors).detect(seen).fused.detections
    )


def test_maps_that_are_made_already_are_used(detectors, frame):
    dense = densify(project_frame(frame))
    dark = replace(dense, reflectance=np.zeros_like(dense.reflectance))
    output = MultimodalDetector(detectors).detect(frame, dark)
    assert output.dense is dark
    assert len(output.scene.modality_detections["rm"]) == 0


def test_maps_are_filled_as_each_detector_learned(detectors, frame, tmp_path):
    path = tmp_path / "sparse.onnx"
    path.write_bytes(bright_cells("rm", filling="sparse"))
    sparse = ModalityDetector(path, 1)
    output = MultimodalDetector({"dm": detectors["dm"], "rm": sparse}).detect(frame)
    maps = fill_maps(project_frame(frame), "sparse")
    assert_same(output.scene.modality_detections["rm"], sparse.detect(map_image(maps, "rm")))
    dense = densify(project_frame(frame))
    assert_same(
        output.scene.modality_detections["dm"], detectors["dm"].detect(map_image(dense, "dm"))
    )


def test_fusion_is_asked_with_all_that_was_seen(detectors, frame):
    asked = {}

    class Silent:
        def fuse(self, scene):
            asked["scene"] = scene
            return FusedDetections.empty()

    output = MultimodalDetector(detectors, Silent()).detect(frame)
    assert len(output.fused) == 0
    scene = asked["scene"]
    assert scene is output.scene
    assert scene.size_px == SIZE_PX
    assert set(scene.modality_detections) == set(scene.class_names) == set(MODALITIES)


def test_detectors_that_a_fusion_was_not_fitted_to_are_named_once(detectors, tmp_path, caplog):
    def open_with(note: str):
        caplog.clear()
        path = tmp_path / "fusion.onnx"
        path.write_bytes(weighted_sums("default", np.eye(3), detectors=note))
        MultimodalDetector(detectors, Fusion(path))
        return caplog.messages

    fitted_to = detector_fingerprints(detectors)
    assert open_with(fitted_to) == open_with("unknown") == []
    others = fitted_to.replace(detectors["dm"].model.fingerprint, "0123456789abcdef")
    (message,) = open_with(others)
    assert message.startswith("fusion.onnx")
    assert detectors["dm"].model.name in message
    assert detectors["rgb"].model.name not in message
    MultimodalDetector({"rgb": detectors["rgb"]}, Fusion(tmp_path / "fusion.onnx"))
    assert len(caplog.messages) == 1


def test_no_detector_or_one_of_another_modality(detectors):
    with pytest.raises(UsageError) as error:
        MultimodalDetector({})
    assert (error.value.where, error.value.found) == ("detectors", "none")
    with pytest.raises(ModelError) as error:
        MultimodalDetector({"rm": detectors["dm"]})
    assert error.value.where == "dm.onnx"
    assert (error.value.expected, error.value.found) == ("a detector of modality rm", "one of dm")
