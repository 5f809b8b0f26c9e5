"""`trifuse train fusion` on a few frames with cars of points, with detectors whose answers are known."""

import io
import json
from contextlib import redirect_stdout
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from data.detections.config import DetectorModelPaths, FusionDataConfig
from data.detections.split_detections import split_detections
from data.samples.config import TrainingDrives
from perception.cli.main import main
from perception.cli.train import parse
from perception.detection.fusion.detector_fusion import detector_fingerprints
from perception.detection.fusion.features import FEATURES
from perception.detection.fusion.rescoring import Fusion
from perception.errors import ModelError, UsageError
from tests.car_frames import SIZE_PX, write_car_frames
from tests.detection.bright_cells import bright_cells
from tests.faults import command, fault


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    root = write_car_frames(tmp_path_factory.mktemp("drive") / "cars", frames=6)
    (root / "training" / "image_2").mkdir()
    for number in range(6):
        image = np.random.default_rng(number).integers(0, 256, (*SIZE_PX[::-1], 3), np.uint8)
        cv2.imwrite(str(root / "training" / "image_2" / f"{number:06d}.png"), image)
    return root


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    words = []
    for modality in ("rgb", "dm", "rm"):
        file = folder / f"{modality}.onnx"
        file.write_bytes(bright_cells(modality, training_data="other/streets"))
        words += [f"--data.models.{modality}", str(file)]
    return words


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


def words_of(drive, models, cache, out, *more):
    words = f"train fusion {drive} --out {out} --data.cache {cache}".split()
    return [*words, *models, *more]


def train(*arguments):
    return main(words_of(*arguments))


SHORT = {
    "default": ["--epochs", "2"],
    "scores": [
        "--config",
        "thesis",
        "--variant",
        "scores",
        "--model.max_partners",
        "0",
        "--epochs",
        "4",
        "--model.sweep.one",
        "2,3",
    ],
}


@pytest.fixture(scope="module", params=SHORT)
def trained(request, drive, models, cache, tmp_path_factory):
    """Return the variant, the folder of its training, and what was printed."""
    out, printed = tmp_path_factory.mktemp(request.param), io.StringIO()
    with redirect_stdout(printed):
        assert train(drive, models, cache, out, *SHORT[request.param]) == 0
    return request.param, out, printed.getvalue()


def test_a_fusion_is_fitted_drawn_and_written(trained, drive, models):
    variant, out, printed = trained
    assert [row in printed for row in ("rgb", "dm", "rm", "fusion")] == [True] * 4
    fusion = Fusion(out / "fusion.onnx")
    assert fusion.variant == variant
    assert fusion.metadata["training_data"] == str(drive)
    opened = DetectorModelPaths(*map(Path, models[1::2])).open()
    assert fusion.metadata["detectors"] == detector_fingerprints(opened)
    metrics = json.loads((out / "metrics.json").read_text())
    counts = metrics["counts"]
    assert [counts[f"{part}_frames"] for part in ("training", "validation", "test")] == [4, 1, 1]
    assert metrics["metadata"]["calibration"] == fusion.metadata["calibration"]
    written = yaml.safe_load((out / "config.yaml").read_text())
    assert written["model"]["variant"] == variant
    pictures = {path.stem for path in out.glob("*.png")}
    figures = {"rescoring", "steps", "precision", "reliability"}
    assert figures <= pictures
    events = EventAccumulator(str(out)).Reload()
    assert {f"test/{name}" for name in figures} <= set(events.Tags()["images"])
    assert ("sizes" in pictures) == (variant == "scores")
    if variant == "scores":
        errors = {tuple(one["hidden"]): one["validation"] for one in metrics["swept"]}
        assert list(errors) == [(2,), (3,)]
        assert fusion.metadata["hidden"] == str(*min(errors, key=errors.__getitem__))
        assert metrics["mean_square_error"]["validation"] == pytest.approx(min(errors.values()))
        assert fusion.metadata["max_partners"] == "0"
        assert fusion.tri_boxes.max_partners == 0
        assert fusion.metadata["calibration"] == "1.0,1.0,0.0"


def says(fusion):
    features = np.random.default_rng(0).uniform(size=(5, len(FEATURES[fusion.variant])))
    return fusion.predict(features)


def test_its_checkpoint_is_exported_as_it_is_calibrated(trained, tmp_path, capsys):
    _, out, _ = trained
    file = tmp_path / "again.onnx"
    assert main(["export", str(out / "best.ckpt"), "--out", str(file)]) == 0
    again, first = Fusion(file), Fusion(out / "fusion.onnx")
    assert again.metadata == first.metadata
    np.testing.assert_array_equal(says(again), says(first))
    report = json.loads(file.with_suffix(".json").read_text())
    assert report["metadata"]["calibration"] == first.metadata["calibration"]
    assert "wrote" in capsys.readouterr().out


def test_a_training_is_not_written_over_but_gone_on_with(trained, drive, models, cache):
    variant, out, _ = trained
    before = Fusion(out / "fusion.onnx")
    with fault(UsageError, str(out), found="last.ckpt", advice="--resume last"):
        command(*words_of(drive, models, cache, out, *SHORT[variant]))
    assert train(drive, models, cache, out, *SHORT[variant], "--resume", "last") == 0
    after = Fusion(out / "fusion.onnx")
    np.testing.assert_array_equal(says(after), says(before))  # it was at its end
    assert after.calibrations == before.calibrations
    config = (out / "config.yaml").read_bytes()
    name, value = {"default": ("max_partners", "8"), "scores": ("hidden", "9")}[variant]
    words = ["--variant", variant, f"--model.{name}", value, "--resume", "last"]
    with fault(ModelError, "last.ckpt", expected=f"whose {name} is"):
        command(*words_of(drive, models, cache, out, *words, "--model.sweep.one", "[]"))
    assert (out / "config.yaml").read_bytes() == config


@pytest.mark.parametrize(("stage", "part"), [("validate", "validation"), ("test", "test")])
def test_a_checkpoint_is_evaluated_on_a_part(trained, stage, part, capsys):
    _, out, _ = trained
    assert main(["train", "fusion", stage, "--resume", str(out / "best.ckpt")]) == 0
    metrics = json.loads((out / f"metrics_{stage}.json").read_text())
    assert metrics["part"] == part
    assert list(metrics["mean_square_error"]) == [part]
    assert f"1 {part} frames" in capsys.readouterr().out
    if stage == "test":
        assert metrics["ap_percent"] == json.loads((out / "metrics.json").read_text())["ap_percent"]


def test_the_test_needs_frames_of_its_own(drive, models, cache):
    files = DetectorModelPaths(*map(Path, models[1::2]))
    config = FusionDataConfig(shares=(90, 5, 5), cache=cache)
    with fault(UsageError, "shares 90,5,5", found="0 in test"):
        split_detections(TrainingDrives((drive,)), files, config, seed=0)


def test_detections_are_cached(drive, models, cache, monkeypatch):
    files = DetectorModelPaths(*map(Path, models[1::2]))
    drives = TrainingDrives((drive,))
    config = FusionDataConfig(cache=cache)
    first = split_detections(drives, files, config, seed=0)

    def refuse(self, frame, dense=None):
        raise AssertionError("detected again")

    monkeypatch.setattr(
        "perception.detection.detectors.multimodal.MultimodalDetector.detect", refuse
    )
    again = split_detections(drives, files, config, seed=0)
    assert [len(p) for p in (first.training, first.validation, first.test)] == [4, 1, 1]
    for one, other in zip(first.training.scenes, again.training.scenes, strict=True):
        np.testing.assert_array_equal(
            one.merged.detections.boxes_px, other.merged.detections.boxes_px
        )


@pytest.mark.slow
def test_processes_detect_the_same(drive, models, cache, tmp_path):
    files = DetectorModelPaths(*map(Path, models[1::2]))
    alone, shared = (
        split_detections(
            TrainingDrives((drive,)), files, FusionDataConfig(cache=folder, cache_workers=count), 0
        )
        for folder, count in ((cache, 1), (tmp_path / "shared", 2))
    )
    for one, other in zip(alone.training.scenes, shared.training.scenes, strict=True):
        np.testing.assert_array_equal(
            one.merged.detections.boxes_px, other.merged.detections.boxes_px
        )
        np.testing.assert_array_equal(one.merged.detections.scores, other.merged.detections.scores)


def test_a_model_of_another_modality_is_refused(drive, models, cache, tmp_path):
    words = ["--data.models.rgb", models[3], *models[2:]]
    with fault(ModelError, expected="a detector of modality rgb"):
        command(*words_of(drive, words, cache, tmp_path))


def test_the_default_configuration_says_what_the_constructors_do():
    plain, default = (
        parse("fusion", ["x", *words])[2].command_config.values
        for words in ([], ["--config", "default"])
    )
    assert default == plain
