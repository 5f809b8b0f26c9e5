"""What the benchmark of detectors rests on: another library says the same, and networks see little."""

import sys

import numpy as np
import pytest

from benchmarks.detectors import Workload, write_detector
from benchmarks.openvino_peer import openvino_network
from benchmarks.stages import PreparedDrive
from data.open_drive import open_drive
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.errors import ImageError, MissingDependencyError
from perception.pipeline import PipelineConfig
from tests.car_frames import write_car_frames
from tests.detection.bright_cells import bright_cells
from tests.faults import fault

SIZE = InputSize(64, 96)


def images(count):
    blocks = np.random.default_rng(0).integers(0, 256, (count, 8, 12, 1), dtype=np.uint8)
    return list(blocks.repeat(8, axis=1).repeat(8, axis=2))


def test_networks_to_time_see_as_much_as_trained_ones(tmp_path):
    files = write_detector(tmp_path, "compact", "dm", SIZE, images(2))
    full, short = (ModalityDetector(files[form]) for form in ("fp32", "int8"))
    inputs = {"images": full.preprocess(images(1)[0])}
    assert np.count_nonzero(full.model(inputs)["scores"] >= 0.01) == pytest.approx(100, abs=2)
    assert short.metadata["form"] == "int8 minmax"


def test_openvino_computes_the_same(tmp_path):
    (tmp_path / "dm.onnx").write_bytes(bright_cells("dm", size=SIZE))
    ours = ModalityDetector(tmp_path / "dm.onnx")
    inputs = {"images": ours.preprocess(images(1)[0])}
    peer, expected = openvino_network(tmp_path / "dm.onnx", 1)(inputs), ours.model(inputs)
    for name, array in expected.items():
        np.testing.assert_allclose(peer[name], array, atol=1e-5)


def test_openvino_that_is_missing_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "openvino", None)
    with fault(MissingDependencyError, expected="openvino", advice='[bench]"'):
        openvino_network(tmp_path / "any.onnx", 1)


def test_a_drive_without_images_is_refused(tmp_path):
    drive = open_drive(write_car_frames(tmp_path / "object", frames=1))
    prepared = PreparedDrive(drive, [drive[0]], [], PipelineConfig())
    with fault(ImageError, expected="a camera image", found="none"):
        Workload.make(prepared, tmp_path)
