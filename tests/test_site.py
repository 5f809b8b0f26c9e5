"""The site builds without a warning, and every command and line of Python on its pages is run."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from data.exports.table_writer import TableWriter
from data.results.result_writer import open_writers
from perception.cli.main import main
from tests.known_result import known_result

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
# Flags that keep a command short; the last of a repeated flag counts.
SHORT = {
    "synth": ["--frames", "4"],
    "run": ["--frames", "3"],
    "track": ["--frames", "3"],
    "evaluate": ["--frames", "3"],
    "shards": ["--size", "64x224"],
    "train": ["--epochs", "1"],
    "train detector": ["--model.size", "64x224", "--trainer.max_steps", "2"],
}
# Frames that a part of a split needs.
SHORT_PAGES = {"training.md": {"synth": ["--frames", "10", "--sensor", "VLP-16"]}}
PAGES = ("tour.md", "training.md")


def blocks(page: str, language: str) -> list[str]:
    text = (DOCS / page).read_text()
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def commands(page: str) -> list[list[str]]:
    lines = "\n".join(blocks(page, "sh")).replace("\\\n", " ").splitlines()
    words = [line.partition("#")[0].split() for line in lines]
    return [line[1:] for line in words if line[:1] == ["trifuse"]]


def shortened(page: str, words: list[str]) -> list[str]:
    known = {**SHORT, **SHORT_PAGES.get(page, {})}
    return [*words, *(flag for n in (1, 2) for flag in known.get(" ".join(words[:n]), []))]


def test_the_site_builds_without_a_warning(tmp_path):
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html"]
    built = subprocess.run(
        [*command, str(DOCS), str(tmp_path / "site")],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr
    page = (tmp_path / "site" / "api.html").read_text()
    assert "perception.types.objects.Boxes3D" in page
    assert "points_velo" in page


@pytest.mark.parametrize("page", PAGES)
def test_commands_of_a_page_run_in_order(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for words in commands(page):
        assert main(shortened(page, words)) == 0, " ".join(words)


def test_python_of_the_tour_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (code,) = blocks("tour.md", "python")
    exec(compile(code, "tour.md", "exec"), {})
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ["0", "1", "2"]


def test_python_of_the_tables_runs(tmp_path, monkeypatch, capsys):
    pytest.importorskip("duckdb")
    with open_writers([TableWriter(tmp_path / "results" / "latest", 0.05)]) as (writer,):
        for index in range(3):
            writer.add(known_result(index), None)
    monkeypatch.chdir(tmp_path)
    (code,) = blocks("tables.md", "python")
    exec(compile(code, "tables.md", "exec"), {})
    rows = [line.split("\u2502")[1:-1] for line in capsys.readouterr().out.splitlines()]
    values = [[cell.strip() for cell in row] for row in rows if len(row) == 4]
    assert values[-2:] == [["4", "Van", "3", "5.0"], ["9", "NULL", "3", "1.0"]]


def test_each_method_page_has_both_methods_metrics_and_an_image_with_its_command():
    pages = [page for page in (DOCS / "method").glob("*.md") if page.name != "index.md"]
    assert len(pages) == 12
    for page in pages:
        text = page.read_text()
        assert "**Thesis" in text, page.name
        assert "**Trifuse.**" in text, page.name
        assert re.search(r"^!\[.+\]\(images/[\w-]+\.jpg\)\n\n`trifuse ", text, re.MULTILINE), (
            page.name
        )
        assert "\n|---" in text, page.name


def test_workflows_call_targets_that_exist():
    targets = set(re.findall(r"^(\w[\w-]*):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    for file in (ROOT / ".github" / "workflows").glob("*.yml"):
        jobs = yaml.safe_load(file.read_text())["jobs"]
        steps = [step.get("run", "") for job in jobs.values() for step in job["steps"]]
        called = {target for step in steps for target in re.findall(r"make (\w+)", step)}
        assert called <= targets, file.name
