"""`trifuse train detector` on a few synthetic frames."""

import json

import pytest
import yaml

from perception.cli.main import main
from tests.car_frames import write_car_frames
from train.checkpoints import read_checkpoint
from train.detector.networks import load_detector

pytestmark = pytest.mark.usefixtures("one_torch_thread")


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return write_car_frames(tmp_path_factory.mktemp("drive"), frames=6)


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


def train(drive, cache, out, *more):
    words = f"train detector {drive} --modality dm --size 64x224 --out {out} --cache {cache}"
    return main([*words.split(), "--batch", "2", "--accelerator", "cpu", *more])


def test_a_detector_is_trained_and_gone_on_with(drive, cache, tmp_path, capsys):
    out = tmp_path / "out"
    assert train(drive, cache, out, "--epochs", "1", "--precision", "32-true") == 0
    printed = capsys.readouterr().out
    assert "compact on dm, epoch 1: AP in percent on 1 validation frames" in printed
    assert train(drive, cache, out, "--epochs", "2", "--resume", "last") == 0
    assert read_checkpoint(out / "last.ckpt", "detector")["epoch"] == 1
    written = yaml.safe_load((out / "config.yaml").read_text())
    assert written["network"]["form"]["modality"] == "dm"
    assert written["network"]["loss"]["box"] == "ciou"
    assert written["data"]["drives"] == [str(drive)]
    assert written["loading"]["batch_size"] == 2
    assert written["resumed_from"] == str(out / "last.ckpt")
    figures = json.loads((out / "figures.json").read_text())
    assert set(figures["precision"]) == {"Car 0.7", "Car 0.5"}
    assert figures["counts"]["training_frames"] == 5
    _, metadata = load_detector(out / "best.ckpt")
    assert (metadata["input_height"], metadata["input_width"]) == ("64", "224")
    assert metadata["training_data"] == str(drive)
    assert metadata["revision"] != "unknown"
    assert train(drive, cache, out) == 2
    assert "go on with --resume last" in capsys.readouterr().err
    other = tmp_path / "other"
    assert train(drive, cache, other, "--start", str(out / "best.ckpt"), "--classes", "Van") == 2
    assert "a detector whose classes is Van, found Car" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("flags", "sentence"),
    [
        ("--epochs 0", "expected at least one of each"),
        ("--nodes 0", "expected at least one of each"),
        ("--patience 0", "expected at least one epoch"),
        ("--resume nothing.ckpt", "no such file"),
        ("--start nothing.ckpt", "no such file"),
        ("--size large", "such as 192x640, found large"),
        ("--size 60x224", "multiples of 32 pixels, such as 192x640, found 60x224"),
        ("--network resnet19", "a trunk of torchvision such as resnet18, found resnet19"),
        ("--classes Unicorn", "at least one Unicorn"),
        ("--classes ,", "class names: expected at least one"),
        ("--darknet_weights some.weights", "expected network yolov2, found compact"),
        ("--backbone_weights some.pth", "expected a trunk of torchvision, found compact"),
        ("--batch 0", "expected a batch size from 1"),
    ],
)
def test_what_cannot_work_is_one_sentence(drive, cache, tmp_path, capsys, flags, sentence):
    assert train(drive, cache, tmp_path, *flags.split()) == 2
    assert sentence in capsys.readouterr().err


def test_the_preset_of_the_thesis(drive, cache, tmp_path, monkeypatch):
    taken = []
    monkeypatch.setattr("train.detector.run.train_detector", lambda *given: taken.append(given))
    flags = "--preset thesis --network yolov2 --jpeg 75 --test_fraction 0.2 --objectness focal"
    words = f"train detector {drive} --modality rm --size 416x416 --out {tmp_path} {flags}"
    assert main(words.split()) == 0
    data, plan, trainer_config, *_ = taken[0]
    assert data.loading.batch_size == 64
    assert (data.rules.jpeg_quality, data.loading.test_fraction) == (75, 0.2)
    assert (plan.optimizer_config.optimizer, plan.optimizer_config.learning_rate) == ("sgd", 0.001)
    assert (plan.loss.box, plan.loss.objectness) == ("squared", "focal")
    assert tuple(plan.form.size) == (416, 416)
    assert trainer_config.watched == "validation/moderate"
