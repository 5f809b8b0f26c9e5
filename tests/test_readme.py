"""Every command and every line of Python in the README is run."""

import re
import subprocess
from pathlib import Path

import pytest

from perception.cli.main import main

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
# Flags that keep a command short; the last of a repeated flag counts.
SHORT = {
    "run": ["--frames", "3"],
    "evaluate": ["--frames", "3"],
    "track": ["--frames", "3"],
    "bench": ["--frames", "3", "--chain-frames", "3"],
    "synth": ["--frames", "3"],
    "detect": ["--frames", "3"],
    "train": ["--epochs", "1"],
}


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


def commands() -> list[list[str]]:
    lines = "\n".join(blocks("sh")).splitlines()
    return [line.partition("#")[0].split() for line in lines if line.strip()]


def needs_kitti(words: list[str]) -> bool:
    return any(word.startswith("kitti/") for word in words)


@pytest.fixture
def place(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(words: list[str]) -> None:
    assert words[0] == "trifuse"
    assert main([*words[1:], *SHORT.get(words[1], [])]) == 0, " ".join(words)


def test_make_targets_exist():
    targets = [words[1] for words in commands() if words[0] == "make"]
    assert targets == ["demo"]
    for target in targets:
        subprocess.run(["make", "--dry-run", target], cwd=ROOT, check=True, capture_output=True)


def test_only_known_programs_are_called():
    assert {words[0] for words in commands()} == {"make", ".", "trifuse"}


def test_commands_that_need_no_data_run_in_order(place):
    for words in commands():
        if words[0] == "trifuse" and not needs_kitti(words):
            run(words)


def test_commands_on_kitti_run(place, kitti_root):
    (place / "kitti").symlink_to(kitti_root)
    for words in commands():
        if words[0] == "trifuse" and needs_kitti(words):
            run(words)


def test_python_runs(place, kitti_root):
    (place / "kitti").symlink_to(kitti_root)
    (code,) = blocks("python")
    short = code.replace("for frame in drive:", "for frame in (drive[0], drive[1]):")
    assert short != code
    exec(compile(short, "README.md", "exec"), {})


def test_linked_files_exist():
    for target in re.findall(r"\]\(([\w/.-]+)\)", README):
        assert (ROOT / target).is_file(), target
