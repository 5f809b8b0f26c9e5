"""`trifuse evaluate depthcn`: its table, plot and document, and what it refuses."""

import json
import shutil
from pathlib import Path

import pytest

from perception.cli.main import main
from tests.car_frames import write_car_frames


def evaluate(*words: str | Path) -> int:
    return main(["evaluate", "depthcn", *map(str, words)])


def cells(printed: str, row: str) -> list[str]:
    """Return what stands in the first row of that name behind it."""
    return next(line for line in printed.splitlines() if line.startswith(row))[len(row) :].split()


def test_table_plot_and_document_say_the_same(car_frames, label_reader, tmp_path, capsys):
    label_reader(car_frames)
    plot, out = tmp_path / "precision.png", tmp_path / "figures.json"
    words = ("--bootstrap", "20", "--plot", plot, "--json", out)
    assert evaluate(car_frames, *words) == 0
    printed = capsys.readouterr().out
    # Six cars are found and nothing else that is as sure: all that so few can come to.
    row = cells(printed, f"{car_frames} moderate")
    assert row[:7] == ["real", "3", "0.7", "6", "100.0", "%", "100.0"]
    assert (row[8], row[-1]) == ("12.50", "12.5")
    assert cells(printed, "thesis, Table 7.9 easy")[:3] == ["real", "7518", "0.7"]
    assert f"{car_frames}: 3.0 ms a frame on average" in printed
    assert "2.0 proposals a frame" in printed
    assert "beside these, not comparable with them" in printed
    document = json.loads(out.read_text())
    assert document["data"][0]["frames_evaluated"] == 3
    assert not document["data"][0]["is_synthetic"]
    assert document["split"] == "the network was trained on: nothing at all"
    drive = document["results"]["drives"][str(car_frames)]
    assert drive["data"] == "real"
    hard = drive["iou"]["0.5"]["hard"]
    assert (hard["objects"], hard["proposal_recall"]) == (6, 1.0)
    assert hard["detections"]["ap_r40_percent"] == hard["max_ap_percent"] == 12.5
    assert hard["detections"]["ap_r40_interval_percent"] == {"low": 12.5, "high": 12.5}
    assert document["results"]["thesis_table_7_9"]["ap_r11_percent"] == {"easy": 37.59}
    assert plot.stat().st_size > 10_000


def test_one_overlap_over_eleven_points(car_frames, label_reader, capsys):
    label_reader(car_frames)
    assert evaluate(car_frames, "--iou", "0.9", "--recall-points", "11", "--frames", "2") == 0
    printed = capsys.readouterr().out
    assert "AP R11 %" in printed
    assert "interval" not in printed
    # Of four cars, one point of the eleven: recall 0 to 0.075.
    assert cells(printed, f"{car_frames} hard")[:4] == ["real", "2", "0.9", "4"]
    assert cells(printed, f"{car_frames} hard")[-2:] == ["9.09", "9.1"]


def test_every_drive_has_its_own_rows(car_frames, label_reader, tmp_path, capsys):
    label_reader(car_frames)
    street = write_car_frames(tmp_path / "street", frames=1)
    # What only synthetic frames have: the class of every point.
    points = (street / "training/velodyne/000000.bin").stat().st_size // 16
    (street / "training/labels").mkdir()
    (street / "training/labels/000000.label").write_bytes(bytes(4 * points))
    assert evaluate(car_frames, street, "--iou", "0.5") == 0
    printed = capsys.readouterr().out
    assert cells(printed, f"{car_frames} easy")[:2] == ["real", "3"]
    assert cells(printed, f"{street} easy")[:2] == ["synthetic", "1"]


def test_levels_of_tracking_labels_decide_who_counts(label_reader, tmp_path, capsys):
    objects = write_car_frames(tmp_path / "objects", frames=1) / "training"
    tracking = tmp_path / "tracking/training"
    for name in ("velodyne/0000", "calib", "label_02"):
        (tracking / name).mkdir(parents=True)
    (objects / "velodyne/000000.bin").rename(tracking / "velodyne/0000/000000.bin")
    (objects / "calib/000000.txt").rename(tracking / "calib/0000.txt")
    car = "0 {} Car {} 0 -1.57 {}.00 150 {}.00 200 1.5 1.6 3.9 0 1.5 20 -1.57"
    rows = [car.format(level, level, 100 + 200 * level, 200 + 200 * level) for level in (0, 1, 2)]
    (tracking / "label_02/0000.txt").write_text("\n".join(rows))
    label_reader(tracking)
    assert evaluate(tracking) == 0
    printed = capsys.readouterr().out
    for difficulty in ("easy", "moderate", "hard"):
        assert cells(printed, f"{tracking} 0000 {difficulty}")[3] == "1"


def test_labels_without_objects(car_frames, label_reader, capsys):
    for file in (car_frames / "training/label_2").iterdir():
        file.write_text("DontCare -1 -1 -10 10 20 30 40 -1 -1 -1 -1000 -1000 -1000 -10\n")
    label_reader(car_frames)
    assert evaluate(car_frames, "--bootstrap", "5") == 0
    row = cells(capsys.readouterr().out, f"{car_frames} easy")
    assert row == ["real", "3", "0.7", "0", *["-"] * 5]


def test_a_drive_without_labels_has_nothing_to_measure(car_frames, label_reader, capsys):
    label_reader(car_frames)
    shutil.rmtree(car_frames / "training/label_2")
    assert evaluate(car_frames) == 2
    assert "expected labelled boxes to measure against" in capsys.readouterr().err


def test_bad_frames_stop_or_are_left_out(car_frames, label_reader, capsys):
    label_reader(car_frames)
    scans = sorted((car_frames / "training/velodyne").iterdir())
    scans[1].write_bytes(b"")
    assert evaluate(car_frames) == 2
    assert "000002.bin" in capsys.readouterr().err
    assert evaluate(car_frames, "--on-bad-frame", "skip") == 0
    assert cells(capsys.readouterr().out, f"{car_frames} easy")[1] == "2"
    for scan in scans:
        scan.write_bytes(b"")
    assert evaluate(car_frames, "--on-bad-frame", "skip") == 2
    assert "expected a frame that can be read, found none" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--frames", "0"), "--frames: expected at least 1, found 0"),
        (("--iou", "1"), "iou: expected from 0 to below 1, found 1"),
        (("--bootstrap", "-1"), "--bootstrap: expected 0 or more, found -1"),
        (("--sequence", "0000"), "sequence 0000: expected none"),
    ],
)
def test_what_cannot_work_is_one_sentence(car_frames, label_reader, capsys, words, sentence):
    label_reader(car_frames)
    assert evaluate(car_frames, *words) == 2
    assert sentence in capsys.readouterr().err
