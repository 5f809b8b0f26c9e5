"""What `trifuse train` says when a training is stopped, or finds the disk full."""

import pytest
import yaml

from data.results.command_config import CommandConfig
from perception.cli.main import main
from perception.errors import MissingDependencyError, UsageError, WriteError
from tests.car_frames import write_car_frames
from tests.faults import command, fault

WORDS = "train depthcn drive --out {out} --epochs 3"


def ends_with(error, monkeypatch, out, *files):
    """Let a training end with an error, after it has written some files."""

    def fit(trainer, module, **_):
        CommandConfig("train depthcn", {"trainer": {"max_epochs": 3}}).write(out)
        for name in files:
            (out / name).touch()
        raise error

    monkeypatch.setattr("lightning.pytorch.Trainer.fit", fit)
    return WORDS.format(out=out).split()


def test_a_stopped_training_says_how_to_go_on(tmp_path, monkeypatch, capsys):
    out = tmp_path / "out"
    words = ends_with(KeyboardInterrupt(), monkeypatch, out, "best.ckpt", "last.ckpt")
    assert main(words) == 130
    words = capsys.readouterr().err.strip().partition("go on with: trifuse ")[2]
    flags = ["--config", f"{out}/config.yaml", "--out", str(out), "--resume", "last"]
    assert words.split() == ["train", "depthcn", *flags]
    taken = []
    monkeypatch.setattr(
        "train.cli.TrainingCLI.run",
        lambda cli, stage, checkpoint, progress: taken.append(
            (cli.config["trainer"]["max_epochs"], stage, checkpoint)
        ),
    )
    command(*words.split())
    assert taken == [(3, "fit", "last")]


def test_a_training_stopped_in_its_first_epoch_is_not_resumed(tmp_path, monkeypatch):
    words = ends_with(KeyboardInterrupt(), monkeypatch, tmp_path)
    with pytest.raises(KeyboardInterrupt) as stopped:
        command(*words)
    assert stopped.value.args == ("start again with the same command, as no epoch is complete",)


def test_a_stopped_search_says_how_to_go_on(tmp_path, monkeypatch):
    def stopped(*settings):
        raise KeyboardInterrupt

    drive = write_car_frames(tmp_path / "cars", frames=2)
    monkeypatch.setattr("train.proposal_search.search.search", stopped)
    with pytest.raises(KeyboardInterrupt) as raised:
        command("train", "proposals", drive, "--out", tmp_path / "out")
    assert raised.value.args == ("go on with the same command",)


@pytest.mark.parametrize(
    ("files", "advice"),
    [(("last.ckpt",), "--resume last"), ((), "start again with the same command")],
)
def test_a_full_disk_is_advised_by_what_is_there(tmp_path, monkeypatch, files, advice):
    full = WriteError("best.ckpt", expected="room", found="No space left on device")
    words = ends_with(full, monkeypatch, tmp_path, *files)
    with fault(WriteError, "best.ckpt", "room", "No space left on device", advice):
        command(*words)


def test_a_training_is_not_overwritten(tmp_path):
    (tmp_path / "last.ckpt").touch()
    with fault(UsageError, str(tmp_path), "a folder without a training", "last.ckpt", "--resume"):
        command(*WORDS.format(out=tmp_path).split())
    assert [path.name for path in tmp_path.iterdir()] == ["last.ckpt"]


def test_everyday_flags_are_short_for_those_of_lightning(tmp_path, capsys):
    words = (
        "train detector fit a b --validation c,d --split s.json --modality rm --batch-size 3 --lr 0.5 "
        "--workers 2 --out out --seed 7 --steps 9 --data.cache-gb 4 --data.no-augment "
        "--trainer.callbacks+=lightning.pytorch.callbacks.DeviceStatsMonitor --model.classes Car,Van --lr_scheduler StepLR --lr_scheduler.step_size 3 --print-config"
    )
    command(*words.split())
    printed = yaml.safe_load(capsys.readouterr().out)
    data, model = printed["data"], printed["model"]
    assert (data["drives"], data["validation"], data["split"]) == (["a", "b"], ["c", "d"], "s.json")
    assert (data["batch_size"], data["workers"], data["cache_gb"]) == (3, 2, 4)
    assert (data["augment"], model["modality"], model["classes"]) == (False, "rm", ["Car", "Van"])
    assert (printed["trainer"]["max_steps"], printed["trainer"]["max_epochs"]) == (9, -1)
    assert printed["optimizer"]["init_args"]["lr"] == 0.5
    assert printed["lr_scheduler"]["init_args"]["step_size"] == 3
    assert printed["seed_everything"] == 7
    (callback,) = printed["trainer"]["callbacks"]
    assert callback["class_path"] == "lightning.pytorch.callbacks.DeviceStatsMonitor"
    assert "default_root_dir" not in printed["trainer"]


def test_a_flag_of_the_module_that_the_data_share_is_given_once(capsys):
    words = "train fusion x --model.variant scores --model.hidden 41 --print-config"
    command(*words.split())
    model = yaml.safe_load(capsys.readouterr().out)["model"]
    assert (model["variant"], model["hidden"]) == ("scores", [41])
    with fault(UsageError, "command line", found="--data.variant"):
        command("train", "fusion", "x", "--data.variant", "scores")


def test_several_configurations_are_read_in_turn(tmp_path, capsys):
    mine = tmp_path / "mine.yaml"
    mine.write_text("trainer: {max_epochs: 2}\noptimizer: {init_args: {lr: 0.25}}\n")
    command("train", "depthcn", "x", "--config", "thesis", "--config", mine, "--print-config")
    printed = yaml.safe_load(capsys.readouterr().out)
    assert (printed["model"]["method"], printed["trainer"]["max_epochs"]) == ("thesis", 2)
    assert printed["optimizer"]["init_args"]["lr"] == 0.25
    assert printed["optimizer"]["init_args"]["weight_decay"] == 0.004


@pytest.mark.parametrize(
    ("flags", "where", "expected", "found"),
    [
        ("--epocs 3", "command line", "a flag such as --epochs", "--epocs"),
        ("--epochs many", "--trainer.max-epochs", "a whole number", "many"),
        ("--modality rm", "command line", "a flag", "--modality"),
        ("--model.method other", "--model.method", "one of default, thesis", "other"),
        ("--config none.yaml", "none.yaml", "a YAML file", "No such file"),
        ("--lr_scheduler Cosine", "--lr-scheduler", "", "Cosine"),
        ("--steps 0", "--steps", "at least 1", "0"),
    ],
)
def test_a_wrong_flag_is_one_sentence(flags, where, expected, found):
    with fault(UsageError, where, expected, found):
        command("train", "depthcn", "x", *flags.split())


def test_a_missing_package_is_named_with_its_extra(monkeypatch):
    def missing(name):
        raise ImportError("No module named 'torch'")

    monkeypatch.setattr("train.trainings.importlib.import_module", missing)
    with fault(MissingDependencyError, found="torch", advice="train"):
        command("train", "depthcn", "x")
