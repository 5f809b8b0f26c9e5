"""What `trifuse train` says when a training is stopped, or finds the disk full."""

import pytest

from perception.cli.main import main
from perception.errors import UsageError, WriteError
from tests.car_frames import write_car_frames
from tests.faults import command, fault

WORDS = "train depthcn drive --out {out} --epochs 3"


def ends_with(error, monkeypatch, out, *files):
    """Let a training end with an error, after it has written some files."""

    def run_experiment(experiment, run, folder, progress):
        folder.on_start()
        for name in files:
            (out / name).touch()
        raise error

    monkeypatch.setattr("train.verifier.run.run_experiment", run_experiment)
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
        "train.verifier.run.run_experiment",
        lambda experiment, run, folder, progress: taken.append((run.epochs, folder.resume)),
    )
    command(*words.split())
    assert taken == [(3, out / "last.ckpt")]


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
