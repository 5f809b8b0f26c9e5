"""`trifuse train proposals`: what it prints and leaves, and what it refuses."""

import json
from pathlib import Path

import cv2
import pytest
import yaml

from perception.cli.main import main
from perception.cli.parser import call
from perception.detection.config import ProposalConfig
from perception.errors import LabelError, PerceptionError, UsageError
from tests.car_frames import write_car_frames
from tests.faults import command, fault

DEFAULTS = ProposalConfig(0.3, 0.04, 1, 0.8)
GRID = (
    *("--grid.cell-m", "0.5", "--grid.min-variance", "0.01"),
    *("--grid.min-points", "2,5", "--grid.radius-m", "0.05,0.5"),
)


@pytest.fixture
def drives(tmp_path: Path) -> list[str]:
    first = write_car_frames(tmp_path / "first drive", frames=2)
    return [str(first), str(write_car_frames(tmp_path / "second", frames=3, cars=3))]


def words_of(drives: list[str], out: Path, *words: str) -> list[str]:
    flags = [*GRID, "--method", "thesis", "--workers", "1", "--out", str(out), *words]
    return ["train", "proposals", *drives, *flags]


def train(drives: list[str], out: Path, *words: str) -> int:
    return main(words_of(drives, out, *words))


def test_tables_files_and_plots_agree(drives, tmp_path, capsys):
    out = tmp_path / "out"
    assert train(drives, out) == 0
    printed = capsys.readouterr().out
    assert "2 drives, 5 frames, 13 labels Car" in printed
    assert "The best 4 of 4 settings" in printed
    document = json.loads((out / "search.json").read_text())
    best = document["settings"][0]
    assert (best["reached"]["0.7"], best["reached"]["0.5"]) == (10, 13)
    assert (best["objects"], best["frames"], best["radius_m"]) == (13, 5, 0.5)
    assert "100.0" in printed
    recall = next(iter(document["recall"].values()))
    assert recall["difficulties"]["all"]["found"] == best["reached"]
    assert recall["proposals"] == best["proposals"]
    assert len(document["search"]["drives"]) == 2
    for name in ("recall_by_count.png", "recall_by_iou.png"):
        assert cv2.imread(str(out / name)) is not None
        assert str(out / name) in printed


@pytest.fixture
def no_plots(monkeypatch) -> None:
    monkeypatch.setattr("perception.render.curve_plots.plot_curves", lambda *_, **__: None)


@pytest.mark.usefixtures("no_plots")
def test_the_best_setting_is_what_other_commands_read(drives, tmp_path, capsys):
    out = tmp_path / "out"
    assert train(drives, out) == 0
    capsys.readouterr()
    found = []

    def command(*, proposals: ProposalConfig = DEFAULTS) -> None:
        """Take parameters."""
        found.append(proposals)

    call("command", command, ["--proposals", str(out / "parameters.yaml")])
    (read,) = found
    assert read == ProposalConfig(**yaml.safe_load((out / "parameters.yaml").read_text()))
    assert read.radius_m == 0.5


@pytest.mark.usefixtures("no_plots")
def test_the_same_command_again_goes_on_and_other_drives_are_refused(drives, tmp_path, capsys):
    out = tmp_path / "out"
    assert train(drives, out) == 0
    first, counts = capsys.readouterr().out, (out / "counts.jsonl").read_bytes()
    assert train(drives, out) == 0
    assert capsys.readouterr().out == first
    assert (out / "counts.jsonl").read_bytes() == counts
    with fault(UsageError, found="those of another, by its drives", advice="another --out"):
        command(*words_of(drives[:1], out))
    assert (out / "counts.jsonl").read_bytes() == counts


@pytest.mark.parametrize(
    ("words", "refusal"),
    [
        (("--object_class", "Tram"), (LabelError, "labels of", "at least one Tram", "13 car")),
        (("--iou", "[]"), (UsageError, "--iou", "one or more", "[]")),
        (("--iou", "1.5"), (PerceptionError, "", "above 0, at most 1", "1.5")),
        (("--workers", "0"), (UsageError, "--workers", "at least 1", "0")),
        (("--grid.cell-m", "[]"), (UsageError, "--grid.cell_m", "values, each once", "[]")),
    ],
)
def test_what_cannot_work_is_refused(drives, tmp_path, words, refusal):
    with fault(*refusal):
        command(*words_of(drives, tmp_path / "out", *words))
    assert not (tmp_path / "out").exists()
