"""Exports whose packages are not installed are refused before the run."""

import sys

import pytest

from data.exports.run_exports import RunExports
from perception.errors import MissingDependencyError
from tests.faults import command, fault


def test_no_export_is_written_without_its_flag(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    RunExports()


@pytest.mark.parametrize(
    ("flag", "package", "extra"), [("--tables", "pyarrow", "tables"), ("--view", "rerun", "view")]
)
def test_a_missing_package_is_named_with_its_extra(monkeypatch, flag, package, extra):
    monkeypatch.setitem(sys.modules, package, None)
    with fault(MissingDependencyError, where=flag, expected=package, advice=f"[{extra}]"):
        command("run", "nowhere", flag)
