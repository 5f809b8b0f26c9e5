"""Evaluations over the sequences of Table 3.1: synthetic drives of a few frames under their names."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from data.open_drive import open_drive
from data.results.counted_scans import (
    CountedImage,
    read_counting_sheet,
    write_counting_sheet,
)
from data.synthetic.drive import SyntheticDrive
from data.synthetic.writer import write_tracking
from perception.cli.main import main
from perception.errors import DriveError
from perception.evaluation.config import ObjectMatchConfig
from perception.evaluation.exact_obstacles import count_exactly
from perception.evaluation.ground import GROUND_CLASSES
from perception.evaluation.obstacle_counts import ObstacleCounts
from perception.geometry.grids import LocalArea
from perception.sensor import VLP_16
from perception.types import Frame, Obstacles, PointState, Result, Voxels
from tests.faults import command, fault

FRAMES = {"1 (0000)": 3, "3 (0011)": 3}
ABSENT = ["2 (0001)", "4 (0013)", "5 (0015)", "6 (0016)", "7 (0017)", "8 (0018)"]


class Level:
    """The ground as a level plane."""

    def height_m(self, xy_m: np.ndarray) -> np.ndarray:
        return np.full(len(xy_m), -1.73)

    def distance_m(self, points_velo: np.ndarray) -> np.ndarray:
        return points_velo[:, 2] + 1.73


def result_of(frame: Frame, states: np.ndarray) -> Result:
    no_voxels = Voxels(np.zeros((0, 3), np.float32), np.zeros(0, np.int64), 0.1)
    obstacles = Obstacles(states.astype(np.uint8), no_voxels, no_voxels)
    return Result(frame, np.eye(4), Level(), obstacles)


def write_sequences(folder: Path) -> None:
    """Write one drive as sequences 0000, 0003, which is in no table, and 0011."""
    training = write_tracking(SyntheticDrive(3, sensor=VLP_16), folder, 0, lambda: None)
    for path in training.glob("*/0000*"):
        for name in ("0003", "0011"):
            copy = path.with_name(path.name.replace("0000", name))
            shutil.copytree(path, copy) if path.is_dir() else shutil.copy(path, copy)


@pytest.fixture(scope="module")
def sequences(make_once: Callable[[str, Callable[[Path], object]], Path]) -> Path:
    return make_once("sequences of table 3.1", write_sequences)


@pytest.fixture
def evaluate(sequences: Path, tmp_path: Path, capsys) -> Callable[..., tuple[str, dict]]:
    """Return a function that evaluates the set, and returns what is printed and the JSON document."""

    def run(measure: str, *flags: str) -> tuple[str, dict]:
        out = tmp_path / "metrics.json"
        words = [measure, str(sequences), "--set", "table-3.1", "--json", str(out), *flags]
        assert main(["evaluate", *words]) == 0
        return capsys.readouterr().out, json.loads(out.read_text())

    return run


def test_the_ground_of_all_sequences_is_the_mean_over_their_frames(evaluate):
    printed, written = evaluate("ground")
    assert written["data"]["set"] == "table-3.1"
    assert written["data"]["absent"] == ABSENT
    drives = written["data"]["drives"]
    assert {name: one["frames_evaluated"] for name, one in drives.items()} == FRAMES
    results = written["results"]
    errors = [one["mde"] for one in results["sequences"].values()]
    frames = [one["frames"] for one in errors]
    mean_m = sum(one["mde_m"] * one["frames"] for one in errors) / sum(frames)
    assert results["total"]["mde_m"] == pytest.approx(mean_m)
    assert results["total"]["frames"] == sum(frames)
    assert results["thesis"] == {"mde_m": 0.086}
    lines = printed.splitlines()
    assert all(name in lines[0] for name in ABSENT)
    rows = [line.split("  ")[0] for line in lines]
    assert rows[5:8] == [*FRAMES, "Total"]


def test_obstacles_of_all_sequences_stand_beside_the_printed_ones(evaluate):
    printed, written = evaluate("obstacles")
    results = written["results"]
    counts = results["counts"]
    assert list(counts) == [*FRAMES, "Total"]
    for key, total in counts["Total"].items():
        assert total == sum(counts[name][key] for name in FRAMES)
    # Houses, trees and posts have no labels.
    labelled = [one["objects"]["objects"] for one in results["sequences"].values()]
    assert counts["Total"]["obstacles"] > sum(labelled) > 0
    assert results["thesis"]["Total"]["missed_obstacles"] == 186
    assert len(results["thesis"]) == 9
    motions = results["motions"]["1 (0000)"]
    assert (motions["thesis_static"], motions["thesis_moving"]) == (11, 5)
    assert motions["static"] + motions["moving"] + motions["unknown"] == len(
        results["sequences"]["1 (0000)"]["object_motions"]
    )
    assert "by exact truth of points, all frames" in printed


def test_tracks_of_all_sequences_are_counted_together(evaluate):
    printed, written = evaluate("datmo", "--methods", "default", "--protocol.view", "all")
    results = written["results"]
    assert list(results["sequences"]) == list(FRAMES)
    assert results["thesis"]["Total"]["missed_moving"] == 3
    total = next(line for line in printed.splitlines() if line.startswith("Total")).split()
    metrics = [one["default"]["by_distance"] for one in results["sequences"].values()]
    assert results["total"]["default"]["TP"] == sum(one["TP"] for one in metrics)
    assert int(total[8]) == sum(one["TP"] for one in metrics)
    assert int(total[10]) == sum(one["FN"] for one in metrics)
    assert printed.count("Total") == 3


def test_one_sequence_of_the_set_can_be_chosen(evaluate):
    _, written = evaluate("ground", "--sequence", "11", "--frames", "2")
    assert {n: one["first_frames"] for n, one in written["data"]["drives"].items()} == {
        "3 (0011)": 2
    }
    assert written["data"]["absent"] == []


def test_a_folder_without_a_sequence_of_the_set_is_an_error(sequences: Path):
    words = ["evaluate", "ground", sequences, "--set", "table-3.1", "--sequence"]
    with fault(DriveError, expected="0000, 0001, 0011", found="0000, 0003, 0011", advice="--set"):
        command(*words, "0003")


def test_the_truth_itself_misses_no_object_and_a_level_street_all(sequences: Path):
    drive = open_drive(sequences, sequence="0000", images=False)
    frame, truth = drive[2], drive.point_truth(2)
    states = np.where(np.isin(truth.classes, GROUND_CLASSES), PointState.GROUND, PointState.STATIC)
    states[truth.is_moving] = PointState.MOVING
    right, level = (
        count_exactly(result_of(frame, predicted), truth, LocalArea(), ObjectMatchConfig()).counts
        for predicted in (states, np.full(len(states), PointState.GROUND))
    )
    assert right.obstacles > right.moving > 0
    assert right == ObstacleCounts(right.obstacles, right.moving)
    assert level == replace(right, missed_obstacles=right.obstacles, missed_moving=right.moving)


def test_random_scans_are_counted_by_exact_truth(evaluate, tmp_path: Path):
    folder = tmp_path / "counts"
    printed, written = evaluate("obstacles", "--counting-sheet", str(folder), "--scans", "2")
    rows = read_counting_sheet(folder / "counting_sheet.csv")
    assert [row.sequence for row in rows] == ["0000", "0000", "0011", "0011"]
    assert {path.name for path in folder.glob("*.jpg")} == {row.image for row in rows}
    results = written["results"]
    assert results["images_counted"] == results["images"] == 4
    assert results["counts"]["Total"]["obstacles"] == sum(row.counts.obstacles for row in rows)
    _, whole = evaluate("obstacles")
    everything = whole["results"]["counts"]["3 (0011)"]
    assert results["counts"]["3 (0011)"]["obstacles"] < everything["obstacles"]
    assert "4 of 4 images" in printed.splitlines()[0]


def test_a_sheet_that_a_person_fills_in_is_read_and_kept(sequences: Path, tmp_path: Path, capsys):
    folder = tmp_path / "counts"
    sheet, words = folder / "counting_sheet.csv", ["evaluate", "obstacles", str(sequences)]
    words += ["--sequence", "0000", "--counting-sheet", str(folder), "--scans", "2"]
    image = "0000,000001,0000_000001.jpg"
    rows = [CountedImage(*image.split(","), None), CountedImage("0000", "000002", "x", None)]
    write_counting_sheet(sheet, rows)
    assert main(words) == 0
    assert "0 of 2 images" in capsys.readouterr().out
    filled = sheet.read_text().replace(image + ",,,,,,", image + ",9,4,3,2,1,0")
    sheet.write_text(filled)
    assert main(words) == 0
    printed = capsys.readouterr().out
    assert "1 of 2 images" in printed
    row = next(line for line in printed.splitlines() if line.startswith("1 (0000)"))
    assert row.split()[2:] == ["9", "4", "3", "2", "1", "0"]
    assert sheet.read_text() == filled


def link_sequence(sequences: Path, folder: Path, *names: str) -> Path:
    """Return a folder with some files of sequence 0000."""
    for name in names:
        link = folder / name
        link.parent.mkdir(parents=True)
        link.symlink_to(sequences / "training" / name)
    return folder


def test_a_person_needs_no_labels(sequences: Path, tmp_path: Path):
    names = ("velodyne/0000", "image_02/0000", "calib/0000.txt")
    drive, folder = link_sequence(sequences, tmp_path / "bare", *names), tmp_path / "counts"
    words = ["evaluate", "obstacles", drive, "--sensor", "VLP-16", "--counting-sheet", folder]
    command(*words)
    rows = read_counting_sheet(folder / "counting_sheet.csv")
    assert [row.counts for row in rows] == [None] * 3
    assert all((folder / row.image).is_file() for row in rows)


def test_a_drive_without_images_cannot_be_counted(sequences: Path, tmp_path: Path):
    names = ("velodyne/0000", "label_02/0000.txt", "calib/0000.txt")
    blind = link_sequence(sequences, tmp_path / "blind", *names)
    words = ["evaluate", "obstacles", blind, "--counting-sheet", tmp_path / "counts"]
    with fault(DriveError, expected="images and a camera calibration of 0000", found="none"):
        command(*words)
    assert not (tmp_path / "counts").exists()
