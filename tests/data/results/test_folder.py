"""Folders of results: what is refused, and what gives way to new results."""

import time
from pathlib import Path

import pytest

from data.results.command_config import CommandConfig
from data.results.folder import RESULT_FILES, ResultsFolder, command_of, started
from data.synthetic.collection import SynthConfig, write_drives
from perception.errors import UsageError, WriteError
from tests.faults import fault

RUN = CommandConfig("run", {"frames": 3})


def choose(path: Path | None, config: CommandConfig = RUN, *, overwrite: bool = False):
    return ResultsFolder.choose(path, config, overwrite=overwrite)


def write(*paths: Path) -> None:
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(path.name)


@pytest.fixture
def results(tmp_path) -> Path:
    """Return a folder with the results of a run."""
    out = choose(tmp_path / "out").prepare()
    write(out / "frames.jsonl", out / "labels/000000.label", out / "data/000000.txt")
    return out


def files_in(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def test_a_prepared_folder_states_its_command_and_configuration(tmp_path):
    out = choose(tmp_path / "new" / "out").prepare()
    assert command_of(out) == "run"
    assert files_in(out) == {"config.yaml"}


def test_no_file_changes_before_the_folder_is_prepared(results):
    before = files_in(results)
    choose(results, overwrite=True)
    choose(results.parent / "other")
    assert files_in(results) == before
    assert not (results.parent / "other").exists()


def test_results_are_refused_and_stay(results):
    before = files_in(results)
    with fault(UsageError, str(results), "without results", "trifuse run", "--overwrite"):
        choose(results)
    assert files_in(results) == before


def test_results_are_replaced_on_demand_and_other_files_stay(results):
    mine = (results / "notes.txt", results / "data/remarks.md", results / "plots/labels/a.png")
    write(*mine)
    assert choose(results, overwrite=True).prepare() == results
    assert files_in(results) == {
        "config.yaml", "notes.txt", "data", "data/remarks.md", "plots", "plots/labels",
        "plots/labels/a.png",
    }  # fmt: skip


def test_parts_of_a_killed_run_are_removed(results):
    write(results / "labels/.000001.part.label", results / ".video.part.mp4")
    choose(results, overwrite=True).prepare()
    assert files_in(results) == {"config.yaml"}


def test_results_of_another_command_are_never_replaced(results):
    for overwrite in (False, True):
        with fault(UsageError, str(results), found="those of `trifuse run`"):
            choose(results, CommandConfig("detect", {}), overwrite=overwrite)


@pytest.mark.parametrize("name", ["video.mp4", "labels/000000.label", "config.yaml"])
@pytest.mark.parametrize("overwrite", [False, True])
def test_files_of_the_user_with_our_names_are_never_replaced(tmp_path, name, overwrite):
    write(tmp_path / name)
    with fault(UsageError, str(tmp_path), "without results", name, "another folder"):
        choose(tmp_path, overwrite=overwrite)
    assert (tmp_path / name).is_file()


def test_a_folder_with_other_files_takes_results(tmp_path):
    write(tmp_path / "notes.txt")
    choose(tmp_path).prepare()
    assert files_in(tmp_path) == {"config.yaml", "notes.txt"}


def test_a_file_is_no_folder(tmp_path):
    write(tmp_path / "file")
    with fault(UsageError, str(tmp_path / "file"), "a folder", "a file"):
        choose(tmp_path / "file")


def test_a_place_that_cannot_be_written_to_is_named(tmp_path):
    write(tmp_path / "file")
    with fault(WriteError, str(tmp_path / "file" / "out"), found="Not a directory"):
        choose(tmp_path / "file" / "out").prepare()


def test_runs_of_the_same_second_get_folders_of_their_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(time, "strftime", lambda _: "2026-11-22_10-00-00")
    folders = [choose(None).prepare() for _ in range(3)]
    name = "results/2026-11-22_10-00-00"
    assert [str(folder) for folder in folders] == [name, f"{name}_2", f"{name}_3"]
    assert (tmp_path / "results/latest").resolve() == tmp_path / f"{name}_3"


@pytest.mark.parametrize("layout", ["raw", "tracking", "object"])
def test_every_file_of_a_synthetic_drive_is_declared(tmp_path, layout):
    write_drives(tmp_path, SynthConfig(layout=layout, frames=1, drives=1))
    declared = {path for pattern in RESULT_FILES["synth"] for path in tmp_path.glob(pattern)}
    assert {path for path in tmp_path.rglob("*") if path.is_file()} <= declared


def test_the_first_item_is_computed_at_once():
    done = []
    items = started(done.append(number) or number for number in range(3))
    assert done == [0]
    assert list(items) == [0, 1, 2]
    assert list(started(iter(()))) == []
