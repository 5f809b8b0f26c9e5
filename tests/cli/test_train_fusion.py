"""`trifuse train fusion` on a few frames with cars of points, with detectors whose answers are known."""

import json
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
import yaml

from perception.cli.main import main
from perception.cli.training.fusion_plan import DetectorFiles, FusionData, split_detections
from perception.detection.fusion.rescoring import Fusion
from tests.car_frames import SIZE_PX, write_car_frames
from tests.detection.bright_cells import bright_cells


@pytest.fixture(autouse=True)
def one_thread():
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


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
        words += [f"--models.{modality}", str(file)]
    return words


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


def train(drive, models, cache, out, *more):
    words = f"train fusion {drive} --out {out} --cache {cache} --validation-share 0.34".split()
    return main([*words, *models, *more])


@pytest.fixture
def run(drive, models, cache, tmp_path):
    return partial(train, drive, models, cache, tmp_path)


@pytest.mark.parametrize(
    ("variant", "more"),
    [("default", ["--epochs", "2", "--hidden", "4"]), ("scores", ["--sweep", "[2,3]"])],
)
def test_a_fusion_is_fitted_drawn_and_written(run, drive, tmp_path, capsys, variant, more):
    assert run("--variant", variant, *more) == 0
    printed = capsys.readouterr().out
    assert [row in printed for row in ("rgb", "dm", "rm", "fusion")] == [True] * 4
    fusion = Fusion(tmp_path / "fusion.onnx")
    assert fusion.variant == variant
    assert fusion.facts["training_data"] == str(drive)
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert figures["trained"]["counts"]["training_frames"] == 4
    assert figures["trained"]["counts"]["validation_frames"] == 2
    assert figures["trained"]["facts"]["calibration"] == fusion.facts["calibration"]
    written = yaml.safe_load((tmp_path / "config.yaml").read_text())
    assert written["network"]["form"]["variant"] == variant
    pictures = {path.stem for path in tmp_path.glob("*.png")}
    assert {"rescoring", "steps", "reliability"} <= pictures
    assert ("sizes" in pictures) == (variant == "scores")
    if variant == "scores":
        assert len(figures["trained"]["swept"]) == 2
        assert fusion.facts["calibration"] == "1.0,1.0,0.0"


def test_detectors_look_once(drive, models, cache, monkeypatch):
    files = DetectorFiles(*map(Path, models[1::2]))
    data = FusionData((drive,), validation_share=0.34, models=files, cache=cache)
    first = split_detections(data, seed=0)

    def refuse(self, frame, dense=None):
        raise AssertionError("looked again")

    monkeypatch.setattr("perception.detection.multimodal.MultimodalDetector.look", refuse)
    again = split_detections(data, seed=0)
    assert (len(first.training), len(first.validation)) == (4, 2)
    for one, other in zip(first.training.scenes, again.training.scenes, strict=True):
        np.testing.assert_array_equal(
            one.merged.detections.boxes_px, other.merged.detections.boxes_px
        )


def test_what_a_detector_learned_from_is_refused(drive, models, cache, tmp_path, capsys):
    learned = tmp_path / "dm.onnx"
    learned.write_bytes(bright_cells("dm", training_data=f"other/streets, {drive}"))
    words = [*models[:3], str(learned), *models[4:]]
    assert train(drive, words, cache, tmp_path) == 2
    assert "found training data of dm (dm.onnx)" in capsys.readouterr().err


def test_a_model_of_another_modality_is_refused(drive, models, cache, tmp_path, capsys):
    words = ["--models.rgb", models[3], *models[2:]]
    assert train(drive, words, cache, tmp_path) == 2
    assert "expected a detector of modality rgb" in capsys.readouterr().err
