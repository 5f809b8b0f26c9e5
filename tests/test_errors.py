"""Errors are sentences whose commands can be copied, true for how this copy was installed."""

import ast
import re
import sys
from importlib import metadata

import pytest

from perception import errors
from perception.cli.main import run_command_line
from perception.errors import MissingDependencyError, PerceptionError, UsageError
from tests.faults import fault
from tests.syntax_trees import ROOT, source_files

# A command outside of backticks, and the punctuation that runs into it.
RUN_INTO = re.compile(r"(?:trifuse|pip) [a-z][^`]*[,.;:)](?:\s|$)")


def missing(extra: str) -> MissingDependencyError:
    return MissingDependencyError("x", needed_for="y", extra=extra, reason=ImportError("no x"))


def test_a_sentence_ends_with_its_advice():
    error = PerceptionError("a", expected="b", found="c", advice="run: trifuse check a")
    assert str(error) == "a: expected b, found c; run: trifuse check a"


def test_a_source_tree_is_installed_with_an_extra():
    assert missing("bench").advice.endswith(f'pip install --editable "{ROOT}[bench]"')


@pytest.mark.parametrize(
    ("record", "requirement"),
    [
        (None, "trifuse[bench]"),
        ('{"url": "file:///a/trifuse.whl"}', "trifuse[bench] @ file:///a/trifuse.whl"),
    ],
)
def test_a_wheel_is_installed_with_an_extra(record, requirement, monkeypatch, tmp_path):
    installed = tmp_path / "trifuse-0.1.0.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text("Name: trifuse\n")
    if record:
        (installed / "direct_url.json").write_text(record)
    monkeypatch.setattr(errors, "__file__", str(tmp_path / "perception/errors.py"))
    found = metadata.Distribution.at(installed)
    monkeypatch.setattr(metadata, "distribution", lambda name: found)
    assert missing("bench").advice.endswith(f'pip install "{requirement}"')


@pytest.mark.parametrize("name", ["bench", "study masks"])
def test_a_wheel_has_no_benchmarks(name, monkeypatch):
    monkeypatch.setitem(sys.modules, "benchmarks", None)
    for module in ("benchmarks.bench", "benchmarks.studies", "benchmarks.studies.masks"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    advice = 'pip install --editable ".[bench]"'
    with fault(PerceptionError, "benchmarks", "benchmarks/", "none", advice):
        run_command_line([*name.split(), "x"])


def texts() -> list[tuple[str, str]]:
    """Return the place and the text of every expectation and advice in the source."""
    return [
        (f"{path}:{node.lineno}", ast.unparse(node.value))
        for path, nodes in source_files()
        for node in nodes
        if isinstance(node, ast.keyword) and node.arg in ("expected", "advice")
    ]


def test_no_punctuation_runs_into_a_command():
    plain = [(place, re.sub(r"`[^`]*`|[fr]?'", "", text)) for place, text in texts()]
    assert [one for one in plain if RUN_INTO.search(one[1])] == []


def test_what_a_flag_lacks_is_said_without_a_full_stop():
    with pytest.raises(UsageError) as caught:
        run_command_line(["run", "x", "--frames"])
    assert str(caught.value).endswith("; see trifuse run --help")


def test_what_a_file_holds_breaks_no_line_and_commands_no_terminal():
    error = PerceptionError("a.feather", expected="x", found="no y among \n, \x1b[2J, é")
    assert str(error) == "a.feather: expected x, found no y among  ,  [2J, é"
