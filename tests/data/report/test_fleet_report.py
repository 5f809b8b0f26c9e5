"""The report of a batch: failed drives by their sentences, numbers that differ as figures, links to each drive's page."""

import json

import pytest

from data.report.fleet_report import fleet_page
from data.report.report_file import write_report
from perception.errors import LabelError
from tests.faults import fault


def row(name, state="done", seconds=2.0, error="", **numbers):
    return {"name": name, "state": state, "frames": 5, "seconds": seconds, "key": "k", "error": error, **numbers}  # fmt: skip


@pytest.fixture
def batch(tmp_path):
    def write(*rows):
        (tmp_path / "drives.jsonl").write_text("".join(f"{json.dumps(one)}\n" for one in rows))
        return tmp_path

    return write


def test_failed_drives_come_first_with_their_sentences(batch):
    folder = batch(
        row("a", seconds=9.0), row("b"), row("c", "failed", error="scan <3>: found none")
    )
    text = write_report(folder).read_text()
    assert "scan &lt;3&gt;: found none" in text
    table = text[text.index("<caption>Drives</caption>") :]
    assert table.index(">c</th>") < table.index(">a</th>") < table.index(">b</th>")


def test_drives_lead_to_their_reports_and_reviews(batch):
    folder = batch(row("a"), row("b"), row("c"))
    for place in ("a/report.html", "b/review.html"):
        (folder / "drives" / place).parent.mkdir(parents=True)
        (folder / "drives" / place).touch()
    table = fleet_page(folder).sections[-1].markup
    assert [f'href="drives/{one}"' in table for one in ("a/report.html", "b/review.html")] == [
        True
    ] * 2
    assert table.count("<a ") == 2


def test_faulty_drives_come_before_slow_ones(batch):
    of_frames = {"a": 5.0, "b": 1.0, "c": 4.0}  # of five, without a finding
    rows = [row(name, **{"health.frames": 5.0, "health.healthy": n}) for name, n in of_frames.items()]  # fmt: skip
    text = write_report(batch(*rows, row("d", seconds=9.0))).read_text()
    table = text[text.index("<caption>Drives</caption>") :]
    places = [table.index(f">{name}</th>") for name in "bcda"]
    assert places == sorted(places)
    assert "80.0 %" in table[places[0] : places[1]]
    assert "20.0 %" in table[places[1] : places[2]]


def test_numbers_that_differ_are_figures_and_columns(batch):
    page = fleet_page(batch(row("a", mde_m=0.1, beams=64.0), row("b", mde_m=0.3, beams=64.0)))
    figures = list(page.plots.figures.values())
    assert [one["data"][0]["name"] for one in figures] == ["seconds", "mde_m"]
    assert figures[1]["data"][0]["y"] == ["b", "a"]  # the largest first
    assert figures[1]["data"][0]["x"] == [0.3, 0.1]


def test_many_drives_are_a_curve_of_sorted_values(batch):
    page = fleet_page(batch(*(row(f"{n:03d}", mde_m=float(n)) for n in range(60))))
    trace = list(page.plots.figures.values())[1]["data"][0]
    assert trace["type"] != "bar"
    assert trace["y"][:2] == [59.0, 58.0]


def test_a_drive_with_a_page_is_linked(batch):
    folder = batch(row("a b"), row("c"))
    (folder / "drives/a b").mkdir(parents=True)
    (folder / "drives/a b/report.html").touch()
    text = write_report(folder).read_text()
    assert '<a href="drives/a%20b/report.html">a b</a>' in text
    assert "drives/c/report.html" not in text


def test_a_damaged_row_is_named(batch):
    folder = batch(row("a"))
    with (folder / "drives.jsonl").open("a") as file:
        file.write("[1, 2]\n")
    with fault(LabelError, "drives.jsonl line 2", expected="a JSON object"):
        fleet_page(folder)
