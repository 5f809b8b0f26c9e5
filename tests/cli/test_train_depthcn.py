"""`trifuse train depthcn` and `trifuse study augmentation` on a few synthetic frames."""

import json

import pytest
import torch
import yaml

from perception.cli.main import main, run_command_line
from perception.errors import ModelError, UsageError, WriteError
from tests.faults import command, fault
from train.checkpoints import read_checkpoint
from train.networks.depthcn import load_verifier


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    root = tmp_path_factory.mktemp("drive")
    words = f"synth {root} --layout object --frames 5 --images false --seed 4".split()
    assert main(words) == 0
    return root


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


# Most of these trainings draw nothing for TensorBoard.
LOGGED = ("--trainer.logger", "true")


def words_of(drive, cache, out, *more):
    words = (
        f"train depthcn {drive} --out {out} --data.cache {cache} --data.batch-size 32 "
        "--trainer.accelerator cpu --trainer.logger false"
    ).split()
    return [*words, *more]


def train(*arguments):
    return main(words_of(*arguments))


@pytest.fixture
def small_previews(monkeypatch):
    monkeypatch.setattr("train.verifier.training._SHOWN_SAMPLES", 2)


@pytest.mark.usefixtures("small_previews")
def test_a_network_is_trained_and_resumed(drive, cache, tmp_path, capsys):
    out = tmp_path / "out"
    assert train(drive, cache, out, "--epochs", "1", *LOGGED) == 0
    assert "validation" in capsys.readouterr().out
    words = f"train depthcn --config {out}/config.yaml --out {tmp_path / 'again'}".split()
    assert main(words) == 0
    for name in ("config.yaml", "hparams.yaml"):
        assert (tmp_path / "again" / name).read_bytes() == (out / name).read_bytes()
    again = read_checkpoint(tmp_path / "again" / "last.ckpt", "depthcn")["state_dict"]
    for key, weight in read_checkpoint(out / "last.ckpt", "depthcn")["state_dict"].items():
        assert torch.equal(again[key], weight)
    assert train(drive, cache, out, "--epochs", "2", "--resume", "last") == 0
    assert read_checkpoint(out / "last.ckpt", "depthcn")["epoch"] == 1
    written = yaml.safe_load((out / "config.yaml").read_text())
    assert (written["model"]["method"], written["trainer"]["max_epochs"]) == ("default", 2)
    assert written["data"]["drives"] == [str(drive)]
    assert written["optimizer"]["init_args"]["lr"] == 0.05
    metrics = json.loads((out / "metrics.json").read_text())["parts"]
    assert 0 <= metrics["validation"]["accuracy"] <= 1
    assert metrics["training"]["vehicles"] > 0
    network, metadata = load_verifier(out / "best.ckpt")
    assert metadata["training_data"] == str(drive)
    assert metadata["revision"] != "unknown"
    assert not network.training
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    for words in (
        ["--model.method", "thesis"],
        ["--validation", "nowhere"],
        ["--optimizer", "AdamW"],
    ):
        assert train(drive, cache, out, "--epochs", "3", "--resume", "last", *words) == 2
        assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def test_a_full_disk_leaves_the_last_whole_epoch(drive, cache, small_disk):
    """There is room for three checkpoints of 2.6 MB and the events of an epoch."""
    small_disk.resize("8500k")
    out = small_disk.path / "out"
    words = words_of(drive, cache, out, "--epochs", "3", *LOGGED)
    with fault(WriteError, where=str(out), found="No space left on device", advice="--resume last"):
        run_command_line(words)
    whole = read_checkpoint(out / "last.ckpt", "depthcn")["epoch"]
    assert whole < 2
    assert load_verifier(out / "best.ckpt")[1]["method"] == "default"
    small_disk.resize("40m")
    assert train(drive, cache, out, "--epochs", "3", "--resume", "last") == 0
    assert read_checkpoint(out / "last.ckpt", "depthcn")["epoch"] == 2


def test_a_checkpoint_is_evaluated_by_the_configuration_beside_it(drive, cache, tmp_path, capsys):
    out = tmp_path / "out"
    assert train(drive, cache, out, "--steps", "2", "--data.shares", "60,20,20") == 0
    fitted = json.loads((out / "metrics.json").read_text())["parts"]["validation"]
    rows = {}
    for stage, part in (("validate", "validation"), ("test", "test")):
        capsys.readouterr()
        assert main(["train", "depthcn", stage, "--resume", str(out / "best.ckpt")]) == 0
        assert f"\n{part} " in capsys.readouterr().out
        rows = json.loads((out / f"metrics_{stage}.json").read_text())["parts"]
        if part == "validation":
            assert rows[part] == pytest.approx(fitted)
    assert set(rows) == {"test"}
    before = sorted(path.name for path in out.iterdir())
    with fault(ModelError, "no.ckpt", found="no such file"):
        command("train", "depthcn", "test", drive, "--resume", tmp_path / "no.ckpt")
    assert sorted(path.name for path in out.iterdir()) == before


@pytest.mark.parametrize(
    ("flags", "refusal"),
    [
        ("--epochs 0", (UsageError, "--epochs", "at least 1", "0")),
        ("--resume nothing.ckpt", (ModelError, "nothing.ckpt", "", "no such file")),
        ("--data.batch-size 1", (UsageError, "", "a batch size from 2", "1")),
    ],
)
def test_what_cannot_work_is_refused(drive, cache, tmp_path, flags, refusal):
    with fault(*refusal):
        command(*words_of(drive, cache, tmp_path, *flags.split()))


@pytest.mark.usefixtures("small_previews")
def test_the_study_of_augmentation_stands_beside_the_thesis(drive, cache, tmp_path, capsys):
    picture = tmp_path / "augmentation.png"
    words = f"study augmentation {drive} --method default --epochs 1 --batch-size 32".split()
    assert main([*words, "--cache", str(cache), "--out", str(picture)]) == 0
    printed = capsys.readouterr().out
    rows = {line.split()[0]: line.split() for line in printed.splitlines() if line}
    assert rows["without"][-2:] == ["92.83", "86.69"]
    assert rows["with"][-2:] == ["96.45", "91.93"]
    numbers = json.loads(picture.with_suffix(".json").read_text())
    assert numbers["repeats"] == "Table 7.8"
    assert set(numbers["results"]["trained"]) == {"without", "with"}
    assert picture.stat().st_size > 10_000
