"""`trifuse report`, and the reports of other commands."""

import json
import sys

import pytest

from perception.cli.flags import ReportFlags
from perception.cli.main import main
from perception.errors import MissingDependencyError
from tests.data.report.conftest import write_run
from tests.data.report.pages import read_page
from tests.faults import command, fault


@pytest.fixture
def run_folder(tmp_path):
    return write_run(tmp_path / "run")


def test_a_report_is_written_again(run_folder, capsys):
    assert main(["report", str(run_folder)]) == 0
    assert capsys.readouterr().out == f"report: {run_folder / 'report.html'}\n"
    assert read_page(run_folder / "report.html").texts["h1"] == ["Run of <street>"]


def test_two_runs_are_compared(run_folder, tmp_path, capsys):
    html = tmp_path / "made" / "both.html"
    other = write_run(tmp_path / "other", scale=0.5)
    assert main(["report", str(run_folder), str(other), "--html", str(html)]) == 0
    assert capsys.readouterr().out == f"report: {html}\n"
    assert "-50.0 %" in read_page(html).words


def test_what_is_no_result_is_one_sentence(tmp_path, capsys):
    assert main(["report", str(tmp_path)]) == 2
    assert "expected a folder that `trifuse run`" in capsys.readouterr().err


def test_without_plotly_the_extra_is_named(run_folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "plotly", None)
    with fault(MissingDependencyError, expected="plotly", advice="[report]"):
        command("report", run_folder)
    with fault(MissingDependencyError, expected="plotly", advice="[report]"):
        ReportFlags(html=run_folder / "x.html")


@pytest.mark.parametrize(
    ("words", "left"),
    [
        ({}, ["a.html", "a.json"]),
        ({"html": "b.html"}, ["a.json", "b.html"]),
        ({"report": False}, ["a.json"]),
        ({"report": False, "html": "b.html"}, ["a.json", "b.html"]),
    ],
)
def test_where_the_report_of_a_document_lies(tmp_path, words, left):
    if "html" in words:
        words = {**words, "html": tmp_path / words["html"]}
    ReportFlags(json=tmp_path / "a.json", **words).write({"rows": {"a": 1.0}})
    assert sorted(path.name for path in tmp_path.iterdir()) == left


def test_a_document_that_is_named_as_a_page_is_not_overwritten(tmp_path):
    ReportFlags(json=tmp_path / "a.html").write({"rows": {"a": 1.0}})
    assert json.loads((tmp_path / "a.html").read_text()) == {"rows": {"a": 1.0}}
    assert (tmp_path / "a.html.html").is_file()


def test_without_plotly_a_document_is_written_and_the_extra_named(tmp_path, monkeypatch, caplog):
    monkeypatch.setitem(sys.modules, "plotly", None)
    ReportFlags(json=tmp_path / "a.json").write({"rows": {"a": 1.0}})
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]
    (line,) = caplog.messages
    assert line.startswith("no report.html: the report: expected the Python package plotly")
    assert "[report]" in line


def test_an_evaluation_leaves_a_report_beside_its_document(street, tmp_path, capsys):
    files = tmp_path / "ground.json", tmp_path / "ground.html"
    words = ["--frames", "2", "--pipeline.no-parallel"]
    assert main(["evaluate", "ground", str(street), *words, "--json", str(files[0])]) == 0
    assert f"report: {files[1]}\n" in capsys.readouterr().out
    document, page = json.loads(files[0].read_text()), read_page(files[1])
    assert page.texts["h1"] == ["Evaluation: ground"]
    assert page.texts["caption"] == [table["title"] for table in document["tables"]]
    assert document["tables"][0]["header"][1] == "mDE [m]"
    assert main(["report", str(files[0]), "--html", str(tmp_path / "again.html")]) == 0
    assert (tmp_path / "again.html").read_bytes() == files[1].read_bytes()
