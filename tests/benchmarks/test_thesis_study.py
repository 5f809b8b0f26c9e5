"""`trifuse study thesis`: what is done once, and the tables of finished experiments."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.studies import thesis as study
from benchmarks.studies.thesis import ThesisExperiments, commands
from benchmarks.studies.thesis_report import (
    depthcn_table,
    draw_curves,
    fusion_rows,
    fusion_table,
    recognition_table,
)
from perception.errors import UsageError
from tests.faults import fault

EXPERIMENTS = ThesisExperiments(steps=3, frames=12, detectors="default")
MODALITIES = ("color", "depth", "reflectance")


def levels(ap: float) -> dict:
    curve = {"precision": [1.0, 0.5, 0.0]}
    return {
        name: {"ap_r11_percent": ap + place, "curve": curve}
        for place, name in enumerate(("easy", "moderate", "hard"))
    }


@pytest.fixture
def asked(monkeypatch):
    """Let commands do nothing; return those that were run."""
    lines = []
    monkeypatch.setattr(study, "run_command_line", lambda words: lines.append(" ".join(words)))
    monkeypatch.setattr("benchmarks.studies.thesis_report.report", lambda *_: None)
    monkeypatch.delenv("KITTI_ROOT", raising=False)
    return lines


def test_every_command_is_run_once(asked, tmp_path):
    study.thesis(experiments=EXPERIMENTS, out=tmp_path)
    assert [" ".join(line.split()[:2]) for line in asked].count("train detector") == 3
    count = len(asked)
    study.thesis(experiments=EXPERIMENTS, out=tmp_path)
    assert len(asked) == count


def test_what_was_stopped_is_resumed(asked, tmp_path):
    (tmp_path / "dm").mkdir()
    (tmp_path / "dm/last.ckpt").touch()
    study.thesis(experiments=EXPERIMENTS, out=tmp_path)
    resumed = [line for line in asked if line.endswith("--resume last")]
    assert [line.split()[5] for line in resumed] == ["dm"]


def test_other_settings_need_another_folder(asked, tmp_path):
    study.thesis(experiments=EXPERIMENTS, out=tmp_path)
    with fault(UsageError, "commands.json", expected="--frames 13", found="--frames 12"):
        study.thesis(experiments=replace(EXPERIMENTS, frames=13), out=tmp_path)


def test_synthetic_frames_are_written_where_there_are_no_others(monkeypatch, tmp_path):
    monkeypatch.delenv("KITTI_ROOT", raising=False)
    assert commands(EXPERIMENTS, tmp_path)["data"][:2] == ["synth", str(tmp_path / "data")]
    named = replace(EXPERIMENTS, data=Path("kitti/object"))
    assert "data" not in commands(named, tmp_path)
    assert commands(named, tmp_path)["split"][1] == "kitti/object"
    (tmp_path / "kitti/object").mkdir(parents=True)
    monkeypatch.setenv("KITTI_ROOT", str(tmp_path / "kitti"))
    assert commands(EXPERIMENTS, tmp_path)["split"][1] == str(tmp_path / "kitti/object")


def test_recognition_stands_beside_table_7_8(tmp_path):
    for name, accuracy in (("without", 0.5), ("with", 0.75)):
        (tmp_path / name).mkdir()
        parts = {part: {"accuracy": accuracy} for part in ("training", "validation")}
        (tmp_path / name / "metrics.json").write_text(json.dumps({"parts": parts}))
    rows = recognition_table(tmp_path).to_json()
    assert rows["with augmentation"]["validation"] == 75
    assert rows["without augmentation"]["thesis validation"] == 86.69


def test_depthcn_stands_beside_table_7_9():
    rows = depthcn_table(levels(20)).to_json()
    first, thesis, _ = rows.values()
    assert list(first.values()) == [20, 21, 22]
    assert list(thesis.values()) == [37.59, None, None]


def test_the_fusions_stand_beside_table_7_10(tmp_path):
    names = (*MODALITIES, "merged by NMS", "fusion on scores", "Trifuse fusion")
    measured = {name: {"0.7": levels(10 * place)} for place, name in enumerate(names)}
    rows = fusion_rows({"rows": measured})
    table = fusion_table(rows).to_json()
    assert list(table) == [*MODALITIES, "fusion on scores", "fusion on all features"]
    assert table["depth"] == {
        "easy": 10,
        "thesis easy": 68.19,
        "moderate": 11,
        "thesis moderate": 54.59,
        "hard": 12,
        "thesis hard": 47.61,
    }
    assert table["fusion on all features"]["easy"] == 50


def test_curves_are_drawn_on_the_test_frames(tmp_path):
    names = (*MODALITIES, "fusion on scores", "fusion on all features")
    rows = {name: levels(10) for name in names}
    steps = {name: {"0.7": levels(5)} for name in ("merged", "rescored", "rescored and suppressed")}
    draw_curves(tmp_path, levels(20), rows, steps)
    numbers = sorted(file.stem for file in tmp_path.iterdir())
    assert numbers == ["figure-7.11", "figure-7.14", "figure-7.15", "figure-7.9"]
