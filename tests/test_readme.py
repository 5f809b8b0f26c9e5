"""Every command and every line of Python in the README is run."""

import re
import subprocess
from pathlib import Path

import pytest

from perception.cli.main import main
from perception.detection.onnx_model import shipped_model

ROOT = Path(__file__).parents[1]
SCANS = 12  # that are left of a raw drive
README = (ROOT / "README.md").read_text()
# Flags that keep a command short, by its first words; the last of a repeated flag counts.
SHORT = {
    "run": ["--frames", "3"],
    "evaluate": ["--frames", "3"],
    "evaluate detection": ["--bootstrap", "20"],
    "evaluate robustness": ["--frames", "1"],
    "track": ["--frames", "3"],
    "bench": ["--frames", "3", "--chain-frames", "3"],
    "study": ["--frame", "2", "--sensor", "VLP-16"],
    "synth": ["--frames", "5"],
    "detect": ["--frames", "3"],
    "train": ["--epochs", "1"],
    "train detector": ["--model.size", "64x224"],
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


@pytest.fixture
def kitti(place, kitti_root) -> Path:
    """Return a folder of KITTI's layouts, of short raw drives, and of a detector where the commands look for them."""
    (place / "kitti").mkdir()
    (place / "detector.onnx").write_bytes(shipped_model("rgb_yolox").read_bytes())
    (place / "detector.yaml").write_text("model: detector.onnx\n")
    for layout in ("tracking", "object"):
        (place / "kitti" / layout).symlink_to(kitti_root / layout)
    for file in (kitti_root / "raw").rglob("*.*"):
        if file.stem.isdigit() and int(file.stem) >= SCANS:
            continue
        short = place / "kitti" / file.relative_to(kitti_root)
        short.parent.mkdir(parents=True, exist_ok=True)
        if file.name.startswith("timestamps"):
            short.write_text("".join(file.read_text().splitlines(keepends=True)[:SCANS]))
        else:
            short.symlink_to(file)
    return place / "kitti"


def run(words: list[str]) -> None:
    assert words[0] == "trifuse"
    shortened = [flag for n in (2, 3) for flag in SHORT.get(" ".join(words[1:n]), [])]
    assert main([*words[1:], *shortened]) == 0, " ".join(words)


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


def test_commands_on_kitti_run(kitti):
    for words in commands():
        if words[0] == "trifuse" and needs_kitti(words):
            run(words)


def test_python_takes_scans(street, place, capsys):
    scans, _ = blocks("python")
    (place / "scans").symlink_to(street / "velodyne_points/data")
    exec(compile(scans, "README.md", "exec"), {})
    printed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in printed if line[0].isdigit()] == ["0", "1", "2", "3"]


def test_python_takes_drives(kitti, capsys):
    _, drives = blocks("python")
    exec(compile(drives, "README.md", "exec"), {})
    assert len(capsys.readouterr().out.splitlines()) == SCANS


def test_the_shortest_use_is_eight_lines():
    scans, _ = blocks("python")
    assert len([line for line in scans.splitlines() if line and "import" not in line]) <= 8


def test_linked_files_exist():
    for target in re.findall(r"\]\(([\w/.-]+)\)", README):
        assert (ROOT / target).is_file(), target
