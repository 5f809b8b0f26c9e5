"""Every number of the thesis has a row in docs/thesis.md, whose functions exist and whose commands run."""

import importlib
import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from data.synthetic.collection import SynthConfig, write_drives
from perception.cli.main import main
from perception.sensor import load_sensor
from tests.car_frames import write_car_frames
from tests.test_documents import fault_of

PAGE = (Path(__file__).parents[1] / "docs/thesis.md").read_text()
# Numbers of the last equation, figure and table of each chapter, and all sections.
EQUATIONS = {"2": 32, "3": 2, "5": 17, "6": 6, "7": 4, "A": 2}
FIGURES = {"2": 8, "3": 3, "5": 16, "6": 8, "7": 17, "A": 3, "B": 4}
TABLES = {"3": 2, "7": 11, "A": 1, "B": 3}
ALGORITHMS = 4
SECTIONS = """2.1 2.1.1 2.1.2 2.1.3 2.2 2.2.1 2.2.2 3.1 3.1.1 3.1.2 3.1.3 3.2 3.2.1 3.2.2 3.3 3.3.1
    5.1 5.1.1 5.1.2 5.1.3 5.2 5.2.1 5.2.2 5.3 5.3.1 5.3.2 5.3.3 5.3.4
    6.1 6.1.1 6.1.2 6.1.3 6.1.4 6.2 6.2.1 6.2.2 6.2.3 6.2.4 7.1 7.1.1 7.1.2 7.2 7.2.1 7.2.2
    A.1 A.2 A.3 A.3.1 B.1 B.2 B.2.1 B.2.2 B.3"""
# Flags that keep a command short, by its first words; the last of a repeated flag counts.
SHORT = {
    "run": "--frames 2 --no-video --no-pipeline.parallel",
    "track": "--frames 2 --no-video --track-id 4",
    "detect": "--frames 1",
    "maps": "--all --frames 1",
    "bench": "--frames 1 --chain-frames 2",
    "evaluate ground": "--frames 2",
    "evaluate obstacles": "--frames 2",
    "evaluate otd": "--frames 2",
    "evaluate detection": "--frames 1",
    "study dense-cloud": "--previous-scans 1 --at 10,3",
    "study gates": "--previous-scans 1",
    "study masks": "--previous-scans 1",
    "study ground-error": "--previous-scans 1 --steps-per-slice 6 --frames 2",
    "study speed": "--previous-scans 1 --voxel-sizes-m 0.4 --frames 1",
    "study stages": "--frames 1",
}
# Tests of the commands that train, or that take seconds on however few frames.
ELSEWHERE = {
    "bench": "tests/benchmarks/test_bench.py",
    "study augmentation": "tests/cli/test_train_depthcn.py",
    "study datmo-film": "tests/benchmarks/test_datmo_film.py",
    "study tracker-parameters": "tests/benchmarks/test_tracker_parameters_study.py",
    "study tracking-results": "tests/benchmarks/test_tracking_results_study.py",
    "study ins-error": "tests/benchmarks/test_tracking_studies.py",
    "study reflectance-maps": "tests/benchmarks/test_detector_studies.py",
    "train depthcn": "tests/cli/test_train_depthcn.py",
    "train detector": "tests/cli/test_train_detector.py",
    "train fusion": "tests/cli/test_train_fusion.py",
    "train proposals": "tests/cli/test_train_proposals.py",
}
HEADING = "| thesis | subject | function | command |"


class Row(NamedTuple):
    numbers: list[str]
    functions: list[str]
    command: str


def rows() -> list[Row]:
    found = []
    for table in PAGE.split(HEADING)[1:]:
        lines = table.strip().split("\n\n")[0].splitlines()[1:]
        for numbers, _, functions, command in (line.strip("| ").split(" | ") for line in lines):
            names = re.findall(r"`([\w.]+)`", functions)
            found.append(Row(numbers.split(", "), names, command.strip("`")))
    return found


def numbered(form: str, counts: dict[str, int]) -> list[str]:
    return [form.format(f"{part}.{n + 1}") for part, count in counts.items() for n in range(count)]


def exists(dotted: str) -> bool:
    """Import the longest prefix that is a module, and look the rest up in it."""
    words = dotted.split(".")
    for length in range(len(words), 0, -1):
        try:
            found = importlib.import_module(".".join(words[:length]))
        except ModuleNotFoundError:
            continue
        for name in words[length:]:
            if (found := getattr(found, name, None)) is None:
                return False
        return length < len(words)
    return False


def starts(command: str) -> tuple[str, str]:
    """Return the first word and the first two words behind `trifuse`."""
    words = command.split()
    return words[1], " ".join(words[1:3])


def run(command: str) -> None:
    shortened = [flag for start in starts(command) for flag in SHORT.get(start, "").split()]
    assert main([*command.split()[1:], *shortened]) == 0


ROWS = rows()
COMMANDS = list(dict.fromkeys(row.command for row in ROWS))
TESTED_HERE = [command for command in COMMANDS if not ELSEWHERE.keys() & set(starts(command))]
# The objects of the thesis' tables are tracks of KITTI, and who counts obstacles looks at images.
ON_KITTI = [one for one in TESTED_HERE if re.search("evaluate otd|--counting-sheet", one)]


def write_drives_and_results(folder: Path) -> None:
    """Write a tracking sequence, object frames, and their labels as results with a score."""
    sensor = load_sensor("VLP-16")
    config = SynthConfig(layout="tracking", frames=8, sensor=sensor, images=False)
    write_drives(folder / "tracking", config)
    write_car_frames(folder / "object", frames=3)
    (folder / "detections").mkdir()
    for file in (folder / "object/training/label_2").iterdir():
        rows = "".join(f"{row} 0.9\n" for row in file.read_text().splitlines())
        (folder / "detections" / file.name).write_text(rows)


@pytest.fixture(scope="module")
def synthetic(make_once: Callable[[str, Callable[[Path], object]], Path]) -> Path:
    return make_once("thesis", write_drives_and_results)


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_number_of_the_thesis_has_one_row():
    numbers = sorted(number for row in ROWS for number in row.numbers)
    assert numbers == sorted(
        [
            *numbered("({})", EQUATIONS),
            *numbered("Fig. {}", FIGURES),
            *numbered("Table {}", TABLES),
            *(f"Algorithm {n + 1}" for n in range(ALGORITHMS)),
            *SECTIONS.split(),
        ]
    )


def test_every_row_names_functions_that_exist():
    assert all(row.functions for row in ROWS)
    assert [name for row in ROWS for name in row.functions if not exists(name)] == []


def test_a_function_that_does_not_exist_would_be_seen():
    assert exists("perception.geometry.se3.inverse")
    assert not exists("perception.geometry.se3.invert")
    assert not exists("perception.geometry.se4.inverse")
    assert not exists("perception.geometry.se3")


@pytest.mark.slow
@pytest.mark.parametrize("command", [one for one in TESTED_HERE if one not in ON_KITTI])
def test_every_command_runs(command, synthetic, place):
    (place / "kitti").symlink_to(synthetic)
    (place / "results").mkdir()
    (place / "results/detections").symlink_to(synthetic / "detections")
    run(command)


@pytest.mark.slow
@pytest.mark.parametrize("command", ON_KITTI)
def test_every_command_on_frames_of_kitti_runs(command, kitti_root, place):
    (place / "kitti").symlink_to(kitti_root)
    run(command)


def test_every_other_command_can_be_parsed_and_is_run_by_another_test():
    for command in set(COMMANDS) - set(TESTED_HERE):
        assert fault_of(command) is None
        one, two = starts(command)
        file = Path(__file__).parents[1] / (ELSEWHERE.get(one) or ELSEWHERE[two])
        assert (
            two.split()[-1] in file.read_text().replace("_", "-")
            if one != "bench"
            else file.exists()
        )
