"""A checkpoint becomes a file that says the same, or an error that says why not."""

import json

import numpy as np
import pytest
import torch

from data.open_drive import open_drive
from export.depthcn import crop_inputs, exportable_verifier, random_inputs
from export.exporters import export_network
from export.result import ExportConfig
from export.variants import compare, torch_runner
from perception.cli.main import main, run_command_line
from perception.detection.depthcn.detector import DepthCn
from perception.detection.depthcn.image import encode_channels
from perception.detection.depthcn.verifier import Verifier
from perception.errors import ModelError, UsageError, WriteError
from tests.car_frames import write_car_frames
from tests.faults import command, fault
from tests.full_disk import file_size_limit


@pytest.fixture(scope="module")
def exported(checkpoint, tmp_path_factory):
    out = tmp_path_factory.mktemp("exported") / "model.onnx"
    assert main(["export", str(checkpoint), "--out", str(out)]) == 0
    return out


def test_file_says_what_the_checkpoint_says(checkpoint, exported):
    exportable = exportable_verifier(checkpoint)
    planes = exportable.inputs["crops"].shape[1]
    batches = [random_inputs(planes, rows, np.random.default_rng(7)) for rows in (1, 0, 13)]
    parity = compare(torch_runner(exportable), Verifier(exported).model, batches)
    assert parity.rows == 14
    assert parity.largest["scores"] < 1e-5
    assert parity.largest["boxes_px"] < 0.01
    scores = Verifier(exported).model(batches[2])["scores"]
    assert scores.std() > 0.05  # else all of this shows nothing
    assert ((scores >= 0) & (scores <= 1)).all()


def test_file_carries_what_training_noted(checkpoint, exported):
    metadata = Verifier(exported).model.metadata
    method = checkpoint.stem
    assert metadata["method"] == method
    assert metadata["window"] == {"default": "metric", "thesis": "box"}[method]
    assert metadata["training_data"] == "two streets"
    assert metadata["revision"] == "0123abc"


def test_thesis_network_returns_its_windows(checkpoint, exported):
    windows = random_inputs(1, 5, np.random.default_rng(0))["windows_px"].astype(np.float64)
    image = np.zeros((375, 1242, 3), np.uint8)
    boxes_px = Verifier(exported).predict(image, windows).boxes_px
    assert np.array_equal(boxes_px, windows) == (checkpoint.stem == "thesis")


def test_report_lies_beside_the_file(exported):
    report = json.loads(exported.with_suffix(".json").read_text())
    assert report["metadata"]["kind"] == "depthcn"
    assert report["opset"] == 18
    full = report["variants"]["fp32"]
    assert full["size_bytes"] == exported.stat().st_size
    assert full["parity"]["noise"]["rows"] == 43
    assert full["parity"]["noise"]["largest"]["scores"] < report["tolerances"]["scores"]
    assert sorted(p.name for p in exported.parent.iterdir()) == ["model.json", "model.onnx"]


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return write_car_frames(tmp_path_factory.mktemp("drive") / "cars", frames=1)


def test_proposals_of_a_drive_are_compared_in_8_bits_too(
    checkpoint, from_file, drive, tmp_path, capsys
):
    out = tmp_path / "model.onnx"
    words = ["export", str(checkpoint), "--out", str(out), "--data", str(drive)]
    assert main([*words, "--int8", "true"]) == 0
    report = json.loads(out.with_suffix(".json").read_text())
    assert report["variants"]["fp32"]["parity"]["candidates"]["rows"] > 0
    assert report["variants"]["int8"]["size_bytes"] < 0.3 * report["variants"]["fp32"]["size_bytes"]
    assert (tmp_path / "model.int8.onnx").is_file()
    assert "scores, candidates" in capsys.readouterr().out


def test_crops_are_of_the_maps_that_the_network_was_trained_with(exported, drive):
    opened, detector = open_drive(drive), DepthCn(exported)
    frame = opened[0]
    (inputs,) = crop_inputs(detector, [frame], opened.sensor)
    dense = detector.densify(frame)
    image = encode_channels(dense, frame.calibration.image_P_velo, opened.sensor.height_m)
    windows = detector.verify_frame(frame).windows_px
    np.testing.assert_array_equal(
        inputs["crops"], detector.verifier.inputs(image, windows)["crops"]
    )


@pytest.fixture
def from_file(exported, monkeypatch):
    """Skip what is slow and tested above: torch's exporter, and the clock."""
    monkeypatch.setattr("export.depthcn.to_onnx", lambda exportable: exported.read_bytes())
    monkeypatch.setattr(
        "export.variants.fastest_ms", lambda networks, batch: dict.fromkeys(networks, 1.0)
    )


def test_difference_beyond_tolerance_leaves_a_report_and_no_file(
    checkpoint, from_file, tmp_path, monkeypatch
):
    monkeypatch.setattr("export.depthcn.TOLERANCES", {"scores": -1.0, "boxes_px": 1.0})
    out = tmp_path / "model.onnx"
    with fault(ModelError, "model.onnx", "scores within -1 of the checkpoint's"):
        command("export", checkpoint, "--out", out)
    assert [p.name for p in tmp_path.iterdir()] == ["model.json"]


def test_a_full_disk_leaves_no_file(checkpoint, from_file, tmp_path):
    words = ["export", str(checkpoint), "--out", str(tmp_path / "model.onnx")]
    with file_size_limit(20_000), fault(WriteError, ".onnx", found="File too large"):
        run_command_line(words)
    assert list(tmp_path.iterdir()) == []


def test_checkpoint_that_diverged_is_not_exported(thesis_checkpoint, tmp_path):
    content = torch.load(thesis_checkpoint, weights_only=True)
    content["state_dict"]["network.classifier.4.bias"][:] = np.nan
    torch.save(content, tmp_path / "nan.ckpt")
    out = tmp_path / "model.onnx"
    with fault(ModelError, expected="finite numbers in output scores"):
        command("export", tmp_path / "nan.ckpt", "--out", out)
    assert not out.exists()


@pytest.mark.parametrize(
    ("content", "found"),
    [
        ({"state_dict": {}, "hyper_parameters": {"model": "sonar"}, "epoch": 0}, "one of sonar"),
        ({"weights": 1}, "a file without state_dict"),
    ],
)
def test_checkpoint_of_another_network(tmp_path, content, found):
    torch.save(content, tmp_path / "other.ckpt")
    with fault(
        ModelError, "other.ckpt", "a checkpoint of bev or depthcn or detector or fusion", found
    ):
        export_network(ExportConfig(tmp_path / "other.ckpt"))


def test_checkpoint_that_is_missing_or_damaged(thesis_checkpoint, tmp_path):
    with fault(ModelError, "gone.ckpt", found="no such file"):
        export_network(ExportConfig(tmp_path / "gone.ckpt"))
    (tmp_path / "half.ckpt").write_bytes(thesis_checkpoint.read_bytes()[:100_000])
    with fault(ModelError, "half.ckpt", found="a file that cannot be read"):
        export_network(ExportConfig(tmp_path / "half.ckpt"))


class Malice:
    """Unpickled, it would make a file."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (open, (str(self.path), "w"))


def test_no_code_of_a_checkpoint_runs(tmp_path):
    torch.save(
        {"state_dict": {}, "hyper_parameters": Malice(tmp_path / "made")}, tmp_path / "evil.ckpt"
    )
    with fault(ModelError, "evil.ckpt", "a checkpoint of bev or depthcn", "cannot be read"):
        command("export", tmp_path / "evil.ckpt", "--out", tmp_path / "model.onnx")
    assert not (tmp_path / "made").exists()


def test_place_that_cannot_be_written_is_named_before_any_work(tmp_path):
    (tmp_path / "file").touch()
    for out, found in (
        (tmp_path / "file" / "model.onnx", "Not a directory"),
        (tmp_path, "Is a directory"),
    ):
        with fault(WriteError, str(out), found=found):
            command("export", tmp_path / "gone.ckpt", "--out", out)


def test_8_bits_need_a_drive(tmp_path):
    with fault(UsageError, "--int8", "--data", "none"):
        command("export", tmp_path / "gone.ckpt", "--out", tmp_path / "model.onnx", "--int8")
