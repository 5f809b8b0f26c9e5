"""The report of a run says what its files hold."""

import base64

import plotly.graph_objects
import pytest

from data.report.report_file import write_report
from data.report.run_data import RunData
from data.report.run_facts import RunFacts
from data.report.run_report import player_frames, run_page, summary_tiles
from perception.errors import DriveError, LabelError
from tests.data.report.pages import read_page
from tests.faults import fault


@pytest.fixture
def run(run_folder) -> RunData:
    return RunData.read(run_folder)


def figures_of(run):
    page = run_page(run)
    return {
        title: page.plots.figures[name]
        for name, title in zip(page.plots.figures, figure_titles(page), strict=True)
    }


def figure_titles(page):
    markup = "".join(section.markup for section in page.sections)
    return [part.partition("</figcaption>")[0] for part in markup.split('plot"><figcaption>')[1:]]


def test_the_page_has_all_parts_and_needs_no_network(run_folder):
    path = write_report(run_folder)
    page = read_page(path)
    assert page.texts["h1"] == ["Run of <street>"]
    assert page.texts["h2"] == [
        "Summary", "Drive", "Tracks", "Ground", "Detection", "Timings", "Health", "Configuration", "Versions",
    ]  # fmt: skip
    assert {link[:1] for link in page.links} == {"#", "d"}
    assert [link for link in page.links if link[0] != "#"] == ["data:,"]
    assert "frames: 3" in page.texts["pre"][0]
    assert "a processor" in page.texts["td"]
    assert path.stat().st_size < 6e6
    assert list(run_folder.glob(".*")) == []


def test_the_player_holds_images_and_objects_of_each_frame(run_folder):
    frames = read_page(write_report(run_folder)).data["frames"]
    assert [one["frame"] for one in frames["frames"]] == [0, 1, 3]
    assert frames["rate_hz"] == 10
    first = frames["frames"][0]
    # The vehicle is nearer than the track.
    assert first["objects"] == [
        ["Car", None, "2.0", "5.8", "0.90"],
        ["Car", 7, "2.0", "10.4", "0.90"],
    ]
    assert len(first["images"]) == 2
    kind, _, data = first["images"][0].partition(",")
    assert kind == "data:image/jpeg;base64"
    assert base64.b64decode(data)[:2] == b"\xff\xd8"


def test_figures_hold_the_values_of_the_files(run):
    figures = figures_of(run)
    speed = figures["Speed over the ground"]["data"]
    assert [(one["name"], one["x"], one["y"]) for one in speed] == [("Car 7", [0, 1, 3], [2, 2, 2])]
    times = {one["name"]: one for one in figures["Times of the stages"]["data"]}
    assert times["ground"]["y"] == [10, 10, None]
    assert times["tracking"]["y"] == [20, 40, 60]
    assert times["end to end"]["y"] == [60, 120, 180]
    (period,) = figures["Times of the stages"]["layout"]["shapes"]
    assert period["y0"] == period["y1"] == 100
    ground = {one["name"]: one["y"] for one in figures["Ground at labelled objects"]["data"]}
    assert ground == {"mean": [2, None], "maximum": [3, None]}
    (curve,) = figures["Precision-recall: Car, fused"]["data"]
    assert (curve["name"], curve["x"][-1], sum(curve["y"])) == ("easy  50.0 % of 9", 1, 21)
    (matrix,) = figures["Vehicles found by each pair of detectors"]["data"]
    assert matrix["z"] == [[3, 3], [3, 3]]


def test_figures_are_valid_for_plotly(run):
    for figure in figures_of(run).values():
        plotly.graph_objects.Figure(figure)


def test_the_summary_counts_what_needs_attention(run):
    tiles = {one.name: one for one in summary_tiles(run)}
    assert (tiles["Frames"].value, tiles["Path"].value) == ("3", "20 m")
    assert tiles["Ground error"].value == "2.0 cm"
    assert tiles["F1 ground"].value == "0.980"
    assert (tiles["End to end, p50"].value, tiles["End to end, p50"].is_bad) == ("120.0 ms", True)
    health = next(one for one in run_page(run).sections if one.title == "Health")
    assert "<dt>Bad frames</dt><dd>1<" in health.markup
    assert "<dt>Skipped stages</dt><dd>1<" in health.markup
    assert "<dt>Invalid points</dt><dd>15<" in health.markup


def test_a_run_without_the_facts_of_a_report_has_one(run_folder):
    (run_folder / "report.json").unlink()
    run = RunData.read(run_folder)
    assert run.facts == RunFacts()
    assert run.period_s == pytest.approx(0.15)
    titles = [section.title for section in run_page(run).sections]
    assert "Ground" not in titles


def test_a_run_without_images_has_a_report(run_folder):
    (run_folder / "video.mp4").unlink()
    page = read_page(write_report(run_folder))
    assert "frames" not in page.data
    assert "No images" in page.words


def test_a_run_without_detectors_has_no_detections(run_folder):
    (run_folder / "vehicles.jsonl").unlink()
    (run_folder / "report.json").unlink()
    run = RunData.read(run_folder)
    assert "Detection" not in [section.title for section in run_page(run).sections]
    assert [len(one.objects) for one in player_frames(run, (0, 2))] == [1, 0, 1]


def test_results_without_a_frame_are_an_error(run_folder):
    (run_folder / "frames.jsonl").write_text("")
    with fault(DriveError, where=str(run_folder), expected="at least one frame", found="no frame"):
        RunData.read(run_folder)


def test_results_without_a_summary_are_an_error(run_folder):
    (run_folder / "summary.json").unlink()
    with fault(DriveError, where=str(run_folder), found="no summary.json"):
        RunData.read(run_folder)


def test_damaged_facts_are_an_error(run_folder):
    (run_folder / "report.json").write_text("[]")
    with fault(LabelError, where="report.json", expected="a RunFacts", found="[]"):
        RunData.read(run_folder)
