"""`trifuse train detector` on a few synthetic frames."""

import json

import pytest
import yaml

from perception.cli.main import main
from perception.errors import LabelError, ModelError, PerceptionError, UsageError
from tests.car_frames import write_car_frames
from tests.data.report.pages import read_page
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
    "--resume last --optimizer SGD",
    "--resume last --validation nowhere",
    "--resume last --model.weights.darknet some.weights",
    "--resume gone.ckpt",
    "--resume last --model.weights.checkpoint BEST --model.network yolov2",
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
    assert (written["data"]["drives"], written["model"]["modality"]) == ([str(drive)], "dm")
    assert written["trainer"]["max_epochs"] == 2
    assert written["model"]["loss"]["box"] == "ciou"
    assert written["ema"]["decay"] == 0.998
    assert written["data"]["batch_size"] == 2
    metrics = json.loads((out / "metrics.json").read_text())
    assert set(metrics["precision"]) == {"Car 0.7", "Car 0.5"}
    assert metrics["counts"]["training_frames"] == 5
    page = read_page(out / "report.html")
    assert page.texts["h2"] == ["Training", "Best epoch", "Configuration"]
    assert "loss" in page.texts["figcaption"]
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
        (
            "--trainer.num_nodes 0",
            (UsageError, "--trainer", "settings that Lightning takes", "num_nodes"),
        ),
        (
            "--trainer.strategy none",
            (UsageError, "--trainer", "settings that Lightning takes", "none"),
        ),
        (
            "--trainer.devices x",
            (UsageError, "--trainer", "settings that Lightning takes", "devices"),
        ),
        ("--trainer.precision 7", (UsageError, "--trainer.precision", "", "7")),
        ("--trainer.epochs 7", (UsageError, "command line", "a flag such as", "--trainer.epochs")),
        ("--optimizer Adm", (UsageError, "--optimizer", "", "Adm")),
        ("--optimizer.rate 1", (UsageError, "--optimizer", "", "rate")),
        ("--ema.decay 1", (UsageError, "--ema.decay", "below 1", "1")),
        (
            "--early_stopping.patience 0",
            (UsageError, "--early_stopping", "at least one epoch", "0"),
        ),
        ("--resume nothing.ckpt", (ModelError, "nothing.ckpt", "", "no such file")),
        (
            "--model.weights.checkpoint nothing.ckpt",
            (ModelError, "nothing.ckpt", "", "no such file"),
        ),
        ("--model.size large", (UsageError, "", "such as 192x640", "large")),
        ("--model.size 60x224", (UsageError, "", "multiples of 32 pixels", "60x224")),
        ("--model.network resnet19", (UsageError, "network", "such as resnet18", "resnet19")),
        ("--model.classes Unicorn", (LabelError, "labels of", "at least one Unicorn", "10 Car")),
        ("--model.classes ,", (UsageError, "class names", "at least one", "none")),
        ("--model.weights.darknet some.weights", (UsageError, "", "network yolov2", "compact")),
        (
            "--model.weights.backbone some.pth",
            (UsageError, "", "a classifier of torchvision", "compact"),
        ),
        ("--data.batch-size 0", (UsageError, "", "a batch size from 1", "0")),
    ],
)
def test_what_cannot_work_is_refused(drive, cache, tmp_path, flags, refusal):
    with fault(*refusal):
        command(*words_of(drive, cache, tmp_path, *flags.split()))


def test_the_configuration_of_the_thesis(drive, capsys):
    flags = "--config thesis --model.loss.objectness focal --print_config --batch-size 4"
    assert main(f"train detector {drive} --modality rm {flags}".split()) == 0
    printed = yaml.safe_load(capsys.readouterr().out)
    model, trainer = printed["model"], printed["trainer"]
    assert (model["network"], model["size"], model["filling"]) == ("yolov2", "416x416", "thesis")
    assert (model["jpeg_quality"], model["anchors"]) == (75, "default")
    assert (model["loss"]["box"], model["loss"]["objectness"]) == ("squared", "focal")
    assert (trainer["max_steps"], trainer["accumulate_grad_batches"]) == (80_200, 8)
    assert printed["data"]["batch_size"] == 4
    assert printed["data"]["augmentation"]["method"] == "thesis"
    assert printed["optimizer"]["class_path"] == "torch.optim.SGD"
    assert printed["optimizer"]["init_args"]["momentum"] == 0.9
    assert printed["lr_scheduler"]["class_path"] == "train.optimization.DarknetSteps"
    assert printed["ema"]["decay"] == 0
