"""`trifuse evaluate detection`: what it prints, draws and writes, and what it refuses."""

import json
from pathlib import Path

import numpy as np
import pytest

from perception.cli.main import main

CAR, CYCLIST = "300 100 400 180", "600 100 640 200"
FRAMES = 50


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    """Return results and labels: a car a frame and a cyclist in every fifth; nine cars in ten are found."""
    results, labels = tmp_path / "found", tmp_path / "object" / "training" / "label_2"
    results.mkdir()
    labels.mkdir(parents=True)
    rng = np.random.default_rng(0)
    for number in range(FRAMES):
        rows = [f"Car 0 0 0.5 {CAR}"] + [f"Cyclist 0 0 0.5 {CYCLIST}"] * (number % 5 == 0)
        text = "".join(f"{row} 1.5 1.6 3.9 1 1.5 20 0.5\n" for row in rows)
        (labels / f"{number:06d}.txt").write_text(text)
        found = [f"Car -1 -1 0.5 {CAR}"] * (number % 10 != 9)
        found += [f"Car -1 -1 0.5 {CYCLIST}"] * (number % 7 == 0)
        unknown = "-1 -1 -1 -1000 -1000 -1000 -10"
        text = "".join(f"{row} {unknown} {rng.random():.4f}\n" for row in found)
        (results / f"{number:06d}.txt").write_text(text)
    return results, tmp_path / "object"


def evaluate(results: Path, *words: str | Path) -> int:
    return main(["evaluate", "detection", str(results), *map(str, words)])


def cells(printed: str, row: str) -> list[str]:
    """Return what stands in a row behind its name."""
    return next(line for line in printed.splitlines() if line.startswith(row))[len(row) :].split()


def test_table_picture_and_document_say_the_same(folders, tmp_path: Path, capsys):
    results, labels = folders
    (results / "000009.txt").unlink()
    (results / "000777.txt").write_text("")
    picture, out = tmp_path / "made" / "precision.png", tmp_path / "made" / "figures.json"
    words = ("--labels", labels, "--bootstrap", 20, "--plot", picture, "--json", out)
    assert evaluate(results, *words) == 0
    printed = capsys.readouterr().out
    assert "found: 53 detections in 50 frames" in printed
    assert "1 frames have no result file, the first 000009: counted as nothing detected" in printed
    assert "1 result files are of none of these frames, the first 000777: not read" in printed
    assert "Cyclist: nothing detected, so it has no figures." in printed
    document = json.loads(out.read_text())
    assert document["data"]["frames"] == FRAMES
    assert document["data"]["frames_without_result"] == [9]
    assert document["protocol"]["values"]["resampling"] == {"choices": 20, "seed": 0}
    assert document["results"]["Cyclist"] == {"iou": 0.5, "difficulties": None}
    for difficulty in ("easy", "moderate", "hard"):
        metrics = document["results"]["Car"]["difficulties"][difficulty]
        assert (metrics["truths"], metrics["matches"]) == (50, 45)
        assert len(metrics["precision"]) == 41
        interval = metrics["ap_r40_interval_percent"]
        row = cells(printed, f"Car {difficulty}")
        assert row[:3] == ["0.7", "50", "45"]
        assert row[8] == f"{metrics['ap_r40_percent']:.2f}"
        assert row[9:12] == [f"{interval['low']:.2f}", "to", f"{interval['high']:.2f}"]
        assert row[12] == f"{metrics['aos_r40_percent']:.2f}"
        assert metrics["aos_r40_percent"] == pytest.approx(metrics["ap_r40_percent"])
    assert {path.name for path in picture.parent.iterdir()} == {"precision.png", "figures.json"}


def test_eleven_points_of_one_class_in_some_frames(folders, tmp_path: Path, capsys):
    results, labels = folders
    frame_list = tmp_path / "val.txt"
    frame_list.write_text("000000\n000001\n000009\n")
    words = ("--labels", labels, "--frames-list", frame_list, "--recall-points", "11")
    assert evaluate(results, *words, "--classes", "car") == 0
    printed = capsys.readouterr().out
    assert "R40" not in printed
    assert "interval" not in printed
    assert cells(printed, "Car easy")[:3] == ["0.7", "3", "2"]
    assert "Pedestrian" not in printed
    assert "Of 40 truths and fewer, the protocol has fewer than 41 thresholds" in printed
    assert "result files are of none of these frames" in printed


def test_any_overlap_and_any_class(folders, capsys):
    results, labels = folders
    for path in results.iterdir():
        path.write_text(path.read_text().replace("300 100 400 180", "300 100 400 170"))
    words = ("--labels", labels, "--classes", "[Car,Tram]", "--iou")
    assert evaluate(results, *words, "0.9") == 0
    printed = capsys.readouterr().out
    assert cells(printed, "Car easy")[:3] == ["0.9", "50", "0"]
    assert "Tram: nothing detected" in printed
    assert evaluate(results, *words, "0.8") == 0
    assert cells(capsys.readouterr().out, "Car easy")[:3] == ["0.8", "50", "45"]


def test_a_class_that_is_not_labelled(folders, capsys):
    results, labels = folders
    (results / "000001.txt").write_text(
        f"Pedestrian -1 -1 -10 {CYCLIST} -1 -1 -1 -1000 -1000 -1000 -10 0.5"
    )
    assert evaluate(results, "--labels", labels) == 0
    printed = capsys.readouterr().out
    assert cells(printed, "Pedestrian hard") == ["0.5", "0", "0", "0.00", "0.00"]
    assert "0 is what the protocol says, not what was measured" in printed
    assert "AOS" not in printed


def test_what_cannot_work_is_one_sentence(folders, tmp_path: Path, capsys):
    results, labels = folders
    assert evaluate(results, "--labels", labels, "--classes", "Tram") == 2
    assert "name any other class together with --iou" in capsys.readouterr().err
    assert evaluate(results, "--labels", labels, "--iou", "1.5") == 2
    assert "iou: expected from 0 to below 1, found 1.5" in capsys.readouterr().err
    assert evaluate(results, "--labels", labels, "--bootstrap", "-3") == 2
    assert "--bootstrap: expected 0 or more, found -3" in capsys.readouterr().err
    (results / "000002.txt").write_text("Car 1 2 3\n")
    assert evaluate(results, "--labels", labels) == 2
    sentence = "000002.txt row 1: expected 16 columns, type to score, found 4."
    assert sentence in capsys.readouterr().err
    assert evaluate(tmp_path / "nowhere", "--labels", labels) == 2
    assert "found no folder" in capsys.readouterr().err
