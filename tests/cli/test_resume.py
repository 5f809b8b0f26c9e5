"""Runs that are killed at random moments and resumed leave the bytes of a run that was not."""

import json
import os
import shutil
import signal
from pathlib import Path

import av
import numpy as np
import pytest

from data.label_proposals.proposal_writer import ProposalWriter
from data.results.run_folder import RunFolder, is_complete
from perception.errors import DriveError, UsageError
from tests.detection.filled_cells import filled_cells
from tests.faults import command, fault
from tests.killed_runs import run_command

FRAMES = 6
# What is measured anew in every run; the clocks of the stages count.
TIMES = {"elapsed_s"}


@pytest.fixture(scope="module")
def drive(make_once) -> Path:
    words = ["--layout", "tracking", "--frames", FRAMES, "--sensor", "VLP-16", "--seed", 3]
    make_once("drive_to_resume", lambda folder: command("synth", folder, *words, "--no-images"))
    return make_once("drive_to_resume", lambda _: None) / "training"


def words_of(drive: Path, out: Path) -> list[str]:
    """Return a run with what needs no images, and a checkpoint every other frame."""
    return ["run", str(drive), "--sequence", "0000", "--out", str(out), "--tables",
            "--checkpoint-frames", "3", "--pipeline.detection.modalities", "dm",
            "--nuscenes", str(out / "nuscenes.json")]  # fmt: skip


@pytest.fixture(scope="module")
def whole(drive, tmp_path_factory) -> Path:
    """Return the results of a run that nothing stops."""
    out = tmp_path_factory.mktemp("whole")
    assert run_command(words_of(drive, out)) == 0
    return out


def content(folder: Path) -> dict[str, object]:
    """Return what all files of a run hold, without the times of this run."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(path.relative_to(folder)): _content(path) for path in files}


def _content(path: Path) -> object:
    if path.name == "summary.json":
        document = json.loads(path.read_text())
        return {key: value for key, value in document.items() if key not in TIMES}
    if path.suffix == ".mp4":  # the same images: an encoder that goes on starts with a header
        with av.open(str(path)) as video:
            return [frame.to_ndarray(format="rgb24").tobytes() for frame in video.decode(video=0)]
    return path.read_bytes()


def test_results_after_kills_at_random_moments_are_the_same(drive, whole, tmp_path, kills):
    expected = content(whole)
    random = np.random.default_rng(7)
    for number in range(kills):
        words = words_of(drive, tmp_path / str(number))
        # Some 20 files are opened a frame, and a hundred at the end; half of the kills come in the midst.
        moment = int(random.integers(2, 180))
        delay_s = float(random.uniform(0, 0.1)) * (number % 2)
        out = tmp_path / str(number)
        code = run_command(words, moment, delay_s)
        assert code in (0, -signal.SIGKILL)
        # A process that is killed on its way out has left a complete run.
        if (out / "checkpoint.zip").exists() or not (out.is_dir() and is_complete(out)):
            assert run_command([*words, "--resume"]) == 0
        found = content(out)
        assert found.keys() == expected.keys(), (moment, delay_s)
        for name, one in expected.items():
            assert found[name] == one, (name, moment, delay_s)


def test_proposals_of_labels_after_a_kill_are_the_same(drive, tmp_path, monkeypatch):
    model, whole, killed = (tmp_path / name for name in ("bev.onnx", "whole", "killed"))
    model.write_bytes(filled_cells())
    words = ["label", str(drive), "--sequence", "0000", "--checkpoint-frames", "2",
             "--pipeline.detection.bev-model", str(model), "--out"]  # fmt: skip
    assert run_command([*words, str(whole)]) == 0
    with monkeypatch.context() as patch:
        patch.setattr(ProposalWriter, "add", _killed_at(4, ProposalWriter.add))
        assert run_command([*words, str(killed)]) == -signal.SIGKILL
    assert sorted(path.name for path in killed.iterdir()) == ["checkpoint.zip", "config.yaml"]
    assert run_command([*words, str(killed), "--resume"]) == 0
    expected, found = content(whole), content(killed)
    assert expected.keys() == found.keys()
    assert json.loads(expected["proposals.json"])["objects"]
    for name in ("proposals.json", "review.html", "boxes/openlabel.json"):
        assert found[name] == expected[name]


def _killed_at(index, add):
    """Return a way to add frames to a writer that ends the process at a frame."""

    def killed(writer, result, selected):
        if result.frame.index == index:
            os.kill(os.getpid(), signal.SIGKILL)
        add(writer, result, selected)

    return killed


@pytest.fixture
def finished(whole, tmp_path) -> Path:
    """Return a copy of the results of a run that is complete."""
    return Path(shutil.copytree(whole, tmp_path / "finished"))


def test_a_complete_run_is_not_resumed(drive, finished):
    with fault(UsageError, where=str(finished), found="one that is complete", advice="--overwrite"):
        command(*words_of(drive, finished), "--resume")


def test_a_run_of_other_flags_is_not_resumed(drive, finished):
    (finished / "summary.json").unlink()
    with fault(UsageError, where=str(finished), found="another frames", advice="config.yaml"):
        command(*words_of(drive, finished), "--resume", "--frames", "3")


def test_a_damaged_checkpoint_leaves_the_results_as_they_are(drive, finished):
    (finished / "checkpoint.zip").write_bytes(b"damaged")
    before = content(finished)
    with fault(DriveError, where="checkpoint.zip", found="a damaged file", advice="--overwrite"):
        command(*words_of(drive, finished), "--resume")
    assert content(finished) == before


def test_results_are_either_gone_on_with_or_replaced(drive, tmp_path):
    with fault(UsageError, where="--resume", expected="no --overwrite"):
        command(*words_of(drive, tmp_path), "--resume", "--overwrite")


def test_a_run_that_found_the_disk_full_goes_on_once_there_is_room(drive, whole, small_disk):
    words = words_of(drive, small_disk.path / "out")
    small_disk.resize("1m")
    assert run_command(words) == 2
    kept = small_disk.path / "out"
    assert all(json.loads(line) for line in (kept / "tracks.jsonl").read_text().splitlines())
    assert RunFolder(kept).poses().shape[1:] == (4, 4)
    small_disk.resize("60m")
    assert run_command([*words, "--resume"]) == 0
    expected, found = content(whole), content(kept)
    assert {name for name in expected if found.get(name) != expected[name]} == set()
