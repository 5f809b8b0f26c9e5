"""`trifuse train detector` on a few synthetic frames."""

import json

import pytest
import yaml

from perception.cli.main import main
from perception.errors import LabelError, ModelError, PerceptionError, UsageError
from tests.car_frames import write_car_frames
from tests.faults import command, fault
from train.checkpoints import read_checkpoint
from train.detector.networks import load_detector


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return write_car_frames(tmp_path_factory.mktemp("drive"), frames=6)


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


def words_of(drive, cache, out, *more):
    words = (
        f"train detector {drive} --modality dm --model.size 64x224 --out {out} --data.cache {cache}"
    )
    flags = "--data.batch-size 2 --trainer.accelerator cpu"
    return [*words.split(), *flags.split(), *more]


def train(*arguments):
    return main(words_of(*arguments))


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


# Of a training that was good: nothing of it may change.
REFUSED = (
    "--resume last --model.network yolov2",
    "--resume last --model.classes Van",
    "--resume last --modality rm",
    "--resume last --optimizer.optimizer sgd",
    "--resume last --validation nowhere",
    "--resume last --weights.darknet some.weights",
    "--resume gone.ckpt",
    "--resume last --weights.checkpoint BEST --model.network yolov2",
    "",
)


def test_a_detector_is_trained_and_resumed(drive, cache, tmp_path, capsys):
    out = tmp_path / "out"
    assert train(drive, cache, out, "--epochs", "1", "--trainer.precision", "32-true") == 0
    printed = capsys.readouterr().out
    assert "compact on dm, epoch 1: AP [%] on 1 validation frames" in printed
    assert train(drive, cache, out, "--epochs", "2", "--resume", "last") == 0
    assert read_checkpoint(out / "last.ckpt", "detector")["epoch"] == 1
    written = yaml.safe_load((out / "config.yaml").read_text())
    assert (written["drives"], written["modality"], written["epochs"]) == ([str(drive)], "dm", 2)
    assert written["loss"]["box"] == "ciou"
    assert written["optimizer"]["ema_decay"] == 0.998
    assert written["data"]["batch_size"] == 2
    metrics = json.loads((out / "metrics.json").read_text())
    assert set(metrics["precision"]) == {"Car 0.7", "Car 0.5"}
    assert metrics["counts"]["training_frames"] == 5
    _, metadata = load_detector(out / "best.ckpt")
    assert (metadata["input_height"], metadata["input_width"]) == ("64", "224")
    assert metadata["training_data"] == str(drive)
    assert metadata["revision"] != "unknown"
    before = contents(out)
    for flags in REFUSED:
        words = [word.replace("BEST", str(out / "best.ckpt")) for word in flags.split()]
        with pytest.raises(PerceptionError):
            command(*words_of(drive, cache, out, "--epochs", "3", *words))
        assert contents(out) == before


@pytest.mark.parametrize(
    ("flags", "refusal"),
    [
        ("--epochs 0", (UsageError, "--epochs", "at least 1", "0")),
        ("--trainer.nodes 0", (UsageError, "", "at least one of each", "0 nodes")),
        ("--trainer.patience 0", (UsageError, "patience", "at least one epoch", "0")),
        ("--resume nothing.ckpt", (ModelError, "nothing.ckpt", "", "no such file")),
        ("--weights.checkpoint nothing.ckpt", (ModelError, "nothing.ckpt", "", "no such file")),
        ("--model.size large", (UsageError, "", "such as 192x640", "large")),
        ("--model.size 60x224", (UsageError, "", "multiples of 32 pixels", "60x224")),
        ("--model.network resnet19", (UsageError, "network", "such as resnet18", "resnet19")),
        ("--model.classes Unicorn", (LabelError, "labels of", "at least one Unicorn", "10 Car")),
        ("--model.classes ,", (UsageError, "class names", "at least one", "none")),
        ("--weights.darknet some.weights", (UsageError, "", "network yolov2", "compact")),
        ("--weights.backbone some.pth", (UsageError, "", "a classifier of torchvision", "compact")),
        ("--data.batch-size 0", (UsageError, "", "a batch size from 1", "0")),
    ],
)
def test_what_cannot_work_is_refused(drive, cache, tmp_path, flags, refusal):
    with fault(*refusal):
        command(*words_of(drive, cache, tmp_path, *flags.split()))


def test_the_preset_of_the_thesis(drive, cache, tmp_path, monkeypatch):
    taken = []
    monkeypatch.setattr("train.detector.run.train_detector", lambda *given: taken.append(given))
    flags = "--preset thesis --model.network yolov2 --data.jpeg-quality 75 --data.shares 60,20,20"
    words = (
        f"train detector {drive} --modality rm --model.size 416x416 --out {tmp_path} {flags} "
        "--loss.objectness focal"
    )
    assert main(words.split()) == 0
    data, config, run, *_ = taken[0]
    assert data.config.batch_size == 64
    assert (data.image.jpeg_quality, data.config.shares) == (75, (60, 20, 20))
    assert (config.optimizer.optimizer, config.optimizer.learning_rate) == ("sgd", 0.001)
    assert (config.loss.box, config.loss.objectness) == ("squared", "focal")
    assert tuple(config.network.size) == (416, 416)
    assert (run.epochs, run.precision) == (40, "auto")
