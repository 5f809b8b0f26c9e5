"""Two runs beside each other."""

import json

import plotly.graph_objects
import pytest

from data.report.report_file import write_report
from tests.data.report.conftest import write_run, write_video
from tests.data.report.pages import read_page


@pytest.fixture
def other_folder(tmp_path):
    """Return a run that takes twice the time and has no frame 3."""
    folder = write_run(tmp_path / "other", scale=2.0)
    write_video(folder)
    lines = (folder / "frames.jsonl").read_text().splitlines()
    (folder / "frames.jsonl").write_text("\n".join(lines[:2]))
    (folder / "config.yaml").write_text("# trifuse 0.1.0: run\nframes: 2\n")
    return folder


def test_two_runs_are_compared(run_folder, other_folder):
    path = write_report(run_folder, other_folder)
    assert path == other_folder / "comparison.html"
    page = read_page(path)
    assert page.texts["h1"] == ["Runs of <street>"]
    assert {"run", "other", "difference", "end to end p50 [ms]"} <= set(page.texts["th"])
    assert "+120 (+100.0 %)" in page.texts["td"]
    assert "-frames: 3\n+frames: 2" in page.texts["pre"][0]
    for figure in page.data["figures"].values():
        plotly.graph_objects.Figure(figure)


def test_frames_of_both_stand_beside_each_other(run_folder, other_folder):
    page = read_page(write_report(run_folder, other_folder))
    frames = page.data["frames"]["frames"]
    assert [(one["frame"], len(one["images"])) for one in frames] == [(0, 4), (1, 4)]
    first = frames[0]["images"]
    assert first[0] == first[1]
    assert first[0] != first[2]
    captions = ["run: Camera", "other: Camera", "run: From above", "other: From above"]
    assert page.texts["figcaption"][:4] == captions
    assert "2 of 3 frames, those of both runs" in page.words


def test_curves_of_one_quantity_have_one_colour(run_folder, other_folder):
    figures = read_page(write_report(run_folder, other_folder)).data["figures"].values()
    traces = [trace for figure in figures for trace in figure["data"]]
    times = {one["name"]: one for one in traces if one["name"].startswith("end to end")}
    first, second = times["end to end, run"], times["end to end, other"]
    assert first["y"] == [60, 120, 180]
    assert second["y"] == [120, 240]
    assert (first["meta"], "dash" in first["line"]) == (second["meta"], False)
    assert second["line"]["dash"] == "dash"


def test_a_run_beside_itself_has_no_differences(run_folder):
    page = read_page(write_report(run_folder, run_folder))
    assert "same configuration" in page.words
    assert {"A: run", "B: run"} <= set(page.texts["th"])


def test_runs_of_two_drives_are_named(run_folder, other_folder):
    summary = json.loads((other_folder / "summary.json").read_text())
    (other_folder / "summary.json").write_text(json.dumps(summary | {"drive": "road"}))
    page = read_page(write_report(run_folder, other_folder))
    assert page.texts["h1"] == ["Runs of <street> and road"]
    assert "different drives" in page.words
