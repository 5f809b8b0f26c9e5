"""`trifuse evaluate results`: what it prints, draws and writes, and what it refuses."""

import json
from pathlib import Path

import numpy as np
import pytest

from perception.cli.main import main
from perception.errors import DriveError, LabelError, UsageError
from tests.faults import command, fault

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
    return main(["evaluate", "results", str(results), *map(str, words)])


def cells(printed: str, row: str) -> list[str]:
    """Return what stands in a row behind its name."""
    return next(line for line in printed.splitlines() if line.startswith(row))[len(row) :].split()


def test_table_plot_and_document_agree(folders, tmp_path: Path, capsys):
    results, labels = folders
    (results / "000009.txt").unlink()
    (results / "000777.txt").write_text("")
    picture, out = tmp_path / "made" / "precision.png", tmp_path / "made" / "metrics.json"
    words = ("--labels", labels, "--bootstrap", 20, "--plot", picture, "--json", out)
    assert evaluate(results, *words) == 0
    printed = capsys.readouterr().out
    assert "found: 53 detections in 50 frames" in printed
    assert "1 frames without a result file, the first 000009: counted as no detection" in printed
    assert "1 result files of other frames, the first 000777: not read" in printed
    assert "Cyclist: nothing detected, so it has no metrics." in printed
    document = json.loads(out.read_text())
    assert document["data"]["frames"] == FRAMES
    assert document["data"]["missing_results"] == [9]
    values = document["protocol"]["values"]
    assert (values["bootstrap"], values["seed"], values["recall_points"]) == (20, 0, [11, 40])
    assert document["results"]["Cyclist"]["0.5"]["easy"]["curve"] is None
    for difficulty in ("easy", "moderate", "hard"):
        metrics = document["results"]["Car"]["0.7"][difficulty]
        assert (metrics["objects"], metrics["found"]) == (50, 45)
        assert len(metrics["curve"]["precision"]) == 41
        names = ("ap_r40_percent", "ap_r40_low_percent", "ap_r40_high_percent", "aos_r40_percent")
        row = cells(printed, f"Car {difficulty} 0.7")
        assert row[:3] == ["50", "45", "90.0"]
        assert row[7:11] == [f"{metrics[name]:.2f}" for name in names]
        assert metrics["aos_r40_percent"] == pytest.approx(metrics["ap_r40_percent"])
    assert {path.name for path in picture.parent.iterdir()} == {
        "precision.png", "metrics.json", "metrics.html"
    }  # fmt: skip


def test_boxes_from_above_and_in_space_have_scores(folders, tmp_path: Path, capsys):
    """Every second car that is found has its 3D box, the others one that lies a storey higher."""
    results, labels = folders
    for number, path in enumerate(sorted(results.iterdir())):
        bottom = 1.5 if number % 2 else -1.5
        size_and_place = f"1.5 1.6 3.9 1 {bottom} 20 0.5"
        rows = path.read_text().splitlines()
        text = "".join(
            f"{row.replace('-1 -1 -1 -1000 -1000 -1000 -10', size_and_place)}\n"
            for row in rows
            if CAR in row
        )
        path.write_text(text)
    out = tmp_path / "metrics.json"
    assert evaluate(results, "--labels", labels, "--json", out) == 0
    printed = capsys.readouterr().out
    table = printed[printed.index("KITTI's object benchmark: AP R40 [%]") :].split("\n\n")[0]
    names = ("2D 0.7", "AOS 0.7", "BEV 0.7", "BEV 0.5", "3D 0.7", "3D 0.5")
    rows = {name: cells(table, f"Car {name}") for name in names}
    assert rows["BEV 0.7"] == rows["BEV 0.5"] == rows["2D 0.7"] == rows["AOS 0.7"]
    scores = json.loads(out.read_text())["results"]["benchmark"]["Car"]
    assert rows["2D 0.7"][0] == f"{scores['image']['0.7']['easy']['ap_r40_percent']:.2f}"
    assert rows["3D 0.5"][0] == f"{scores['3d']['0.5']['easy']['ap_r40_percent']:.2f}"
    found = {name: scores[name]["0.7"]["easy"]["found"] for name in ("image", "bev", "3d")}
    assert found == {"image": 45, "bev": 45, "3d": 20}
    assert "Objects, easy / moderate / hard: Car 50 / 50 / 50" in table
    interval = rows["2D 0.7"][1]
    low, high = map(float, interval.split(".."))
    assert low < float(rows["2D 0.7"][0]) < high


def test_results_without_3d_boxes_have_scores_in_the_image_alone(folders, capsys):
    results, labels = folders
    assert evaluate(results, "--labels", labels) == 0
    printed = capsys.readouterr().out
    assert "Car 2D 0.7" in printed
    assert "BEV" not in printed
    assert "3D" not in printed


def test_results_are_printed_beside_published_detectors(folders, tmp_path: Path, capsys):
    results, labels = folders
    out = tmp_path / "metrics.json"
    words = ("--labels", labels, "--recall-points", "40", "--json", out)
    assert evaluate(results, *words, "--published", "table-7.11") == 0
    printed = capsys.readouterr().out
    # Table 7.11 in the order of the thesis, then the files, by the 11 points of that time.
    table = printed[printed.index("Table 7.11") :]
    names = ("MV3D", "3D FCN", "MV-RGBD-RF", "VeloFCN", "thesis", "Vote3D", "CSoR", "mBoW")
    rows = [line.rsplit(maxsplit=3) for line in table.splitlines()[3:12]]
    assert [row[0] for row in rows] == [*(f"published: {name}" for name in names), "these results"]
    assert rows[4][1:] == ["64.77", "46.77", "39.38"]
    document = json.loads(out.read_text())
    ours = document["results"]["published"]["these results"]
    assert rows[-1][1:] == [f"{ours[level]:.2f}" for level in ("easy", "moderate", "hard")]
    assert evaluate(results, "--labels", labels, "--recall-points", "11", "--json", out) == 0
    cars = json.loads(out.read_text())["results"]["Car"]["0.7"]
    assert ours == {level: cars[level]["ap_r11_percent"] for level in ours}
    *_, note, report = table.splitlines()
    assert "50 frames of" in note
    assert report == f"report: {out.with_suffix('.html')}"


@pytest.mark.parametrize("words", [("--classes", "Cyclist"), ("--iou", "0.5")])
def test_published_detectors_are_of_cars_at_their_iou(folders, words):
    results, labels = folders
    flags = ("--labels", labels, "--published", "table-7.9", *words)
    with fault(UsageError, "--published", "detections of Car at IoU 0.7", found=words[1]):
        command("evaluate", "results", results, *flags)


def test_eleven_points_of_one_class_in_some_frames(folders, tmp_path: Path, capsys):
    results, labels = folders
    frame_list = tmp_path / "val.txt"
    frame_list.write_text("000000\n000001\n000009\n")
    words = ("--labels", labels, "--frame-list", frame_list, "--recall-points", "11")
    words += ("--bootstrap", "0")
    assert evaluate(results, *words, "--classes", "car") == 0
    printed = capsys.readouterr().out
    assert "R40" not in printed
    assert "95 %" not in printed
    assert cells(printed, "Car easy 0.7")[:2] == ["3", "2"]
    assert "Pedestrian" not in printed
    assert "With 40 objects or fewer" in printed
    assert "result files of other frames" in printed


def test_any_overlap_and_any_class(folders, capsys):
    results, labels = folders
    for path in results.iterdir():
        path.write_text(path.read_text().replace("300 100 400 180", "300 100 400 170"))
    words = ("--labels", labels, "--classes", "Car,Tram", "--iou")
    assert evaluate(results, *words, "0.9") == 0
    printed = capsys.readouterr().out
    assert cells(printed, "Car easy 0.9")[:2] == ["50", "0"]
    assert "Tram: no labelled object of this class" in printed
    assert evaluate(results, *words, "0.8") == 0
    assert cells(capsys.readouterr().out, "Car easy 0.8")[:2] == ["50", "45"]


def test_a_class_that_is_not_labelled(folders, capsys):
    results, labels = folders
    (results / "000001.txt").write_text(
        f"Pedestrian -1 -1 -10 {CYCLIST} -1 -1 -1 -1000 -1000 -1000 -10 0.5"
    )
    assert evaluate(results, "--labels", labels, "--bootstrap", "0") == 0
    printed = capsys.readouterr().out
    assert cells(printed, "Pedestrian hard 0.5") == ["0", "0", "-", "-", "-", "-"]
    assert "AOS" not in printed


def test_labels_without_any_class_that_is_measured(folders, capsys):
    results, labels = folders
    for path in (labels / "training" / "label_2").iterdir():
        path.write_text(path.read_text().replace("Car", "Tram").replace("Cyclist", "Misc"))
    assert evaluate(results, "--labels", labels, "--bootstrap", 0) == 0
    note = "Car, Pedestrian, Cyclist: no labelled object of these classes, so they have no metrics."
    assert capsys.readouterr().out.splitlines()[-1] == note


@pytest.mark.parametrize(
    ("flags", "expected", "advice"),
    [
        (("--classes", "Tram"), "Car", "name any other class together with --iou"),
        (("--iou", "1.5"), "from 0 to below 1", ""),
        (("--bootstrap", "-3"), "0 or more", ""),
    ],
)
def test_unusable_flags_are_an_error(folders, flags, expected, advice):
    results, labels = folders
    with fault(UsageError, flags[0], expected, found=flags[1], advice=advice):
        command("evaluate", "results", results, "--labels", labels, *flags)


def test_results_that_cannot_be_read_are_an_error(folders, tmp_path: Path):
    results, labels = folders
    with fault(DriveError, where="nowhere", found="no folder"):
        command("evaluate", "results", tmp_path / "nowhere", "--labels", labels)
    (results / "000002.txt").write_text("Car 1 2 3\n")
    with fault(LabelError, "000002.txt row 1", "16 columns, type to score", "4"):
        command("evaluate", "results", results, "--labels", labels)
