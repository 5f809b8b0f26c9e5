"""`trifuse evaluate results` of tracks: equal to the benchmark's own tool, count by count."""

import json
import tarfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from perception.cli.main import main
from perception.errors import DriveError, LabelError, UsageError
from tests.faults import command, fault

_SHARED = Path(__file__).parents[3] / "shared"
_ORACLE = _SHARED / "oracle"
_REPORTED = _SHARED / "bug_reports" / "tracks"
_COUNTS = ("TP", "FP", "FN", "IDSW", "Frag", "MT", "PT", "ML", "IDTP", "IDFP", "IDFN")
_RATIOS = (
    *("HOTA", "DetA", "AssA", "LocA", "DetRe", "DetPr", "AssRe", "AssPr", "HOTA(0)", "LocA(0)"),
    *("MOTA", "MOTP", "MODA", "sMOTA", "IDF1", "IDP", "IDR"),
)


@pytest.fixture(scope="module")
def oracle(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Return tracks and labels, and what the benchmark's tool says of them."""
    if not (_ORACLE / "tracking_expected.json").is_file():
        pytest.skip(f"no figures of the benchmark's tool in {_ORACLE}")
    folder = tmp_path_factory.mktemp("oracle")
    with tarfile.open(_ORACLE / "tracking_inputs.tar.xz") as archive:
        archive.extractall(folder, filter="data")
    expected = json.loads((_ORACLE / "tracking_expected.json").read_text())
    return folder / "tracking", expected


def evaluate(*words: str | Path) -> int:
    return main(["evaluate", "results", *map(str, words)])


@pytest.mark.parametrize("tracker", ["perturbed", "iou_rrc", "corner"])
def test_every_figure_is_that_of_the_benchmarks_tool(oracle, tmp_path, capsys, tracker):
    folder, expected = oracle
    out = tmp_path / "tracks.json"
    words = ("--labels", folder / "gt", "--seqmap", folder / "seqmap.txt", "--json", out)

    assert evaluate(folder / "trackers" / tracker, *words) == 0

    document = json.loads(out.read_text())
    assert document["data"]["frames"] == expected["sequences"]
    assert document["protocol"]["values"]["alphas"] == expected["alphas"]
    assert list(document["results"]) == [*expected["sequences"], "COMBINED"]
    for sequence, by_class in expected["trackers"][tracker].items():
        for name, metrics in by_class.items():
            assert_same(document["results"][sequence][name], metrics)
    printed = capsys.readouterr().out
    assert "6 of 6 labelled sequences, 1862 frames" in printed
    for name in ("car", "pedestrian"):
        combined = expected["trackers"][tracker]["COMBINED"][name]
        row = combined_row(printed, name)
        assert row[1] == f"{100 * combined['HOTA']:.3f}"
        assert row[8:] == [str(combined[count]) for count in _COUNTS[:8]]


def assert_same(found: dict[str, Any], expected: dict[str, Any]) -> None:
    assert set(found) == set(expected) == {*_COUNTS, *_RATIOS, "per_alpha"}
    assert {name: found[name] for name in _COUNTS} == {name: expected[name] for name in _COUNTS}
    for name in _RATIOS:
        assert found[name] == pytest.approx(expected[name], abs=1e-8), name
    for name, values in expected["per_alpha"].items():
        tolerance = 0 if name in ("TP", "FP", "FN") else 1e-8
        np.testing.assert_allclose(found["per_alpha"][name], values, atol=tolerance, rtol=0)


def combined_row(printed: str, name: str) -> list[str]:
    lines = printed[printed.index(f"{name}: KITTI 2D boxes") :].splitlines()
    return next(line.split() for line in lines if line.startswith("COMBINED"))


def test_scores_are_the_same_at_any_length_of_a_sequence(oracle, tmp_path):
    folder, _ = oracle
    written = []
    for words in ([], ["--seqmap", folder / "seqmap.txt"]):
        out = tmp_path / "tracks.json"
        labels = folder / "gt" / "label_02"
        assert evaluate(folder / "trackers/iou_rrc", "--labels", labels, *words, "--json", out) == 0
        written.append(json.loads(out.read_text())["results"])
    assert written[0] == written[1]


LABELS = """0 1 Car 0 0 0 100 100 150 150 1 1 1 0 0 9 0
0 2 Cyclist 0 0 0 200 100 250 150 1 1 1 0 0 9 0
1 1 Car 0 0 0 100 100 150 150 1 1 1 0 0 9 0
"""
RESULTS = """0 8 Car -1 -1 -10 100 100 150 150 -1 -1 -1 -1000 -1000 -1000 -10 1
1 9 Car -1 -1 -10 100 100 150 150 -1 -1 -1 -1000 -1000 -1000 -10 1
1 7 Cyclist -1 -1 -10 200 100 250 150 -1 -1 -1 -1000 -1000 -1000 -10 1
"""


@pytest.fixture
def small(tmp_path: Path) -> tuple[Path, Path]:
    """Return the folders of results and labels of one short sequence."""
    for folder, text in (("results", RESULTS), ("label_02", LABELS)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "0000.txt").write_text(text)
    return tmp_path / "results", tmp_path / "label_02"


def test_classes_may_be_chosen(small, capsys):
    results, labels = small
    assert evaluate(results, "--labels", labels, "--classes", "cyclist") == 0
    printed = capsys.readouterr().out
    assert printed.startswith(f"{results}: 1 of 1 labelled sequences, 2 frames")
    assert "car:" not in printed
    # One missed, one false: MOTA is -100 %.
    assert combined_row(printed, "cyclist")[5] == "-100.000"
    assert evaluate(results, "--labels", labels, "--classes", "Cyclist,car") == 0
    printed = capsys.readouterr().out
    assert combined_row(printed, "car")[8:12] == ["2", "0", "0", "1"]
    assert "cyclist:" in printed


def test_an_empty_file_is_a_tracker_without_tracks(small, capsys):
    results, labels = small
    (results / "0000.txt").write_text("")
    assert evaluate(results, "--labels", labels, "--classes", "car") == 0
    row = combined_row(capsys.readouterr().out, "car")
    assert row[1:8] == ["0.000", "0.000", "0.000", "100.000", "0.000", "0.000", "0.000"]
    assert row[8:] == ["0", "0", "2", "0", "0", "0", "0", "1"]


def test_a_sequence_without_labels_is_an_error(small):
    results, labels = small
    (results / "0001.txt").touch()
    with fault(DriveError, "0001.txt", "the labels of sequence 0001", "no file"):
        command("evaluate", "results", results, "--labels", labels)


def test_labels_in_place_of_results_are_an_error(small):
    results, labels = small
    (results / "0000.txt").write_text(LABELS)
    with fault(LabelError, "0000.txt row 1", "18 columns", "17"):
        command("evaluate", "results", results, "--labels", labels)


def test_an_unknown_class_is_an_error(small):
    results, labels = small
    with fault(UsageError, "--classes", "car, pedestrian, cyclist", "car,bus"):
        command("evaluate", "results", results, "--labels", labels, "--classes", "car,bus")


def mot_rows(*frames_and_ids: tuple[int, int], left: int = 100) -> str:
    return "".join(f"{frame},{id},{left},100,50,50,1,-1,-1,-1\n" for frame, id in frames_and_ids)


def test_rows_of_motchallenge_count_as_the_class_that_is_labelled(small, capsys):
    results, labels = small
    (results / "0000.txt").write_text(mot_rows((1, 8), (2, 9)))
    assert evaluate(results, "--labels", labels) == 0
    printed = capsys.readouterr().out
    assert f"{results}: MOTChallenge's rows state no class: all count as car" in printed
    assert "pedestrian" not in printed
    assert combined_row(printed, "car")[8:12] == ["2", "0", "0", "1"]
    assert evaluate(results, "--labels", labels, "--classes", "cyclist") == 0
    assert combined_row(capsys.readouterr().out, "cyclist")[8:12] == ["0", "2", "1", "0"]


@pytest.mark.parametrize(
    ("classes", "found"),
    [("car,cyclist", "labels of car and cyclist"), ("car,pedestrian", "labels of no car and no")],
)
def test_rows_without_a_class_need_one(small, classes, found):
    results, labels = small
    (results / "0000.txt").write_text(mot_rows((1, 8)))
    if "pedestrian" in classes:
        (labels / "0000.txt").write_text(LABELS.replace("Car", "Tram"))
    with fault(UsageError, "--classes", "one class, as MOTChallenge's", found, "name the class"):
        command("evaluate", "results", results, "--labels", labels, "--classes", classes)


def test_reported_tracks_in_motchallenges_columns_are_perfect(capsys):
    if not _REPORTED.is_dir():
        pytest.skip(f"no inputs of bug reports in {_REPORTED}")
    assert evaluate(_REPORTED / "motchallenge", "--labels", _REPORTED / "labels") == 0
    row = combined_row(capsys.readouterr().out, "car")
    assert row[1:12] == [*["100.000"] * 7, "60", "0", "0", "0"]


def test_reported_tracks_counted_from_frame_one_are_scored_as_they_stand(capsys, tmp_path):
    if not _REPORTED.is_dir():
        pytest.skip(f"no inputs of bug reports in {_REPORTED}")
    out = tmp_path / "tracks.json"
    words = ("--labels", _REPORTED / "labels", "--json", out)
    assert evaluate(_REPORTED / "from_frame_1", *words) == 0
    printed = capsys.readouterr().out
    assert combined_row(printed, "car")[1] == "85.714"
    note = (
        "0000: 100 % of 60 rows fit the labels of frame k-1 better than those of their own frame k, IoU 1.00 instead of "
        "0.88: are frames counted from 1? They are scored as they stand."
    )
    assert printed.splitlines()[1] == note
    assert json.loads(out.read_text())["data"]["notes"] == [note]


def test_right_numbers_of_real_trackers_are_not_doubted(oracle, capsys):
    folder, _ = oracle
    assert evaluate(folder / "trackers/iou_rrc", "--labels", folder / "gt") == 0
    assert "better than" not in capsys.readouterr().out


def test_a_class_without_labels_is_stated(small, capsys):
    results, labels = small
    assert evaluate(results, "--labels", labels) == 0
    car, pedestrian = capsys.readouterr().out.split("\n\n")[1:]
    note = "The labels hold no object of this class that the protocol counts: its ratios state nothing."
    assert note not in car
    assert pedestrian.splitlines()[-1] == note


def test_results_in_data_as_the_benchmarks_tool_has_them(small, capsys):
    results, labels = small
    (results / "data").mkdir()
    (results / "0000.txt").rename(results / "data" / "0000.txt")
    assert evaluate(results, "--labels", labels, "--classes", "car") == 0
    assert combined_row(capsys.readouterr().out, "car")[8:12] == ["2", "0", "0", "1"]


def test_sequences_by_another_name(small, capsys):
    results, labels = small
    (results / "0000.txt").rename(results / "0.txt")
    words = ("evaluate", "results", results, "--labels", labels)
    found = "0.txt where the labels have 0000.txt"
    with fault(DriveError, str(results), "results named SSSS.txt", found, "names of their labels"):
        command(*words)
    (results / "0001.txt").write_text("")
    (labels / "0001.txt").write_text(LABELS)
    assert evaluate(*words[2:]) == 0
    printed = capsys.readouterr().out
    assert (
        "1 of 2 labelled sequences, 2 frames\n0.txt: not read, as the labels are 0000.txt"
        in printed
    )
    seqmap = results.parent / "seqmap.txt"
    seqmap.write_text("0000 empty 0 2\n")
    with fault(DriveError, "0000.txt", "the results of sequence 0000", "0.txt", "rename 0.txt"):
        command(*words, "--seqmap", seqmap)
