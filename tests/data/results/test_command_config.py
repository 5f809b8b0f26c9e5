"""The configuration of a command, from a file that a command wrote or a person."""

import json
from pathlib import Path

import pytest

from data.results.command_config import CommandConfig, read_config
from perception.errors import UsageError
from tests.faults import fault


def test_what_is_written_is_read(tmp_path):
    CommandConfig("run", {"drive": Path("a/b"), "iou": (0.7, 1e-7), "out": None}).write(tmp_path)
    file = tmp_path / "config.yaml"
    assert file.read_text().splitlines()[0].endswith(": run")
    assert read_config(file) == {"drive": "a/b", "iou": [0.7, 1e-7], "out": None}


def test_a_report_holds_the_configuration_that_it_was_made_with(tmp_path):
    file = tmp_path / "report.json"
    file.write_text(json.dumps({"measure": "ground", "configuration": {"frames": 3}}))
    assert read_config(file) == {"frames": 3}


def test_zeros_of_a_name_are_kept(tmp_path):
    file = tmp_path / "config.yaml"
    file.write_text("sequence: 0001\nframes: 10\ntrack: 0\nscore: 0.5\n")
    assert read_config(file) == {"sequence": "0001", "frames": 10, "track": 0, "score": 0.5}


def test_an_empty_file_sets_no_flag(tmp_path):
    (tmp_path / "config.yaml").touch()
    assert read_config(tmp_path / "config.yaml") == {}


@pytest.mark.parametrize(
    ("name", "data", "found"),
    [
        ("a.yaml", b"- a\n- b\n", "a list"),
        ("a.yaml", b"frames: [3\n", "expected ',' or ']'"),
        ("a.yaml", b"\xff\xfe\x00", "decode"),
        ("a.json", b"{", "Expecting"),
        ("folder", None, "Is a directory"),
    ],
)
def test_what_is_no_configuration_is_refused(name, data, found, tmp_path):
    path = tmp_path / name
    path.mkdir() if data is None else path.write_bytes(data)
    with fault(UsageError, f"--config {path}", "flags and their values", found):
        read_config(path)
