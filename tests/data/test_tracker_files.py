"""Which files of a tracker's results belong to which labels."""

from pathlib import Path

import pytest

from data.kitti.tracker_files import label_folder, pair_with_labels, read_seqmap, sequences_in
from perception.errors import DriveError, LabelError
from tests.faults import fault

LABEL = "{frame} 4 Car 0 0 -1.5 10 20 30 40 1.5 1.8 4.2 -3 1.7 20 0.25\n"
RESULT = "{frame} 4 Car -1 -1 -10 10 20 30 40 -1 -1 -1 -1000 -1000 -1000 -10 0.75\n"


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    """Return results of one sequence and labels of two."""
    results, labels = tmp_path / "results", tmp_path / "root" / "training" / "label_02"
    results.mkdir()
    labels.mkdir(parents=True)
    (results / "0001.txt").write_text(RESULT.format(frame=7))
    for name in ("0001", "0002"):
        (labels / f"{name}.txt").write_text(LABEL.format(frame=5))
    (labels / "readme.txt").write_text("no labels")
    return results, labels


def test_labels_are_found_from_any_folder_above(folders):
    labels = folders[1]
    assert [label_folder(path) for path in (labels, *labels.parents[:2])] == [labels] * 3
    assert sequences_in(labels) == ["0001", "0002"]
    with fault(DriveError, expected="labels named SSSS.txt", found="none"):
        label_folder(labels.parents[2])
    with fault(DriveError, found="no such folder"):
        label_folder(labels / "nowhere")


def test_without_a_seqmap_sequences_are_those_with_results(folders):
    (files,) = pair_with_labels(*folders)
    assert files.name == "0001"
    rows = files.read()
    assert rows.frame_count == 8  # up to the last row of the results
    assert (len(rows.labels), len(rows.results)) == (1, 1)


def test_an_empty_result_file_is_a_sequence_without_tracks(folders):
    results, labels = folders
    (results / "0002.txt").write_text("")
    rows = pair_with_labels(results, labels)[1].read()
    assert (rows.frame_count, len(rows.results)) == (6, 0)
    (labels / "0002.txt").write_text("")
    assert pair_with_labels(results, labels)[1].read().frame_count == 0


def test_a_seqmap_names_sequences_and_their_lengths(folders, tmp_path):
    seqmap = tmp_path / "seqmap.txt"
    seqmap.write_text("0001 empty 000000 000008\n\n")
    (files,) = pair_with_labels(*folders, seqmap)
    assert files.read().frame_count == 8
    seqmap.write_text("0001 empty 000000 000007\n")
    with fault(LabelError, where="0001.txt row 1", expected="frames from 0 to 6", found="'7'"):
        pair_with_labels(*folders, seqmap)[0].read()


def test_missing_files_say_what_to_do(folders, tmp_path):
    results, labels = folders
    seqmap = tmp_path / "seqmap.txt"
    seqmap.write_text("0001 empty 000000 000008\n0002 empty 000000 000008\n")
    with fault(DriveError, where="0002.txt", expected="the results", advice="add an empty file"):
        pair_with_labels(results, labels, seqmap)
    (results / "0003.txt").touch()
    with fault(DriveError, where="0003.txt", expected="the labels of sequence 0003"):
        pair_with_labels(results, labels)
    with fault(DriveError, expected="results named SSSS.txt", found="none"):
        pair_with_labels(tmp_path, labels)
    with fault(DriveError, expected="a folder of results"):
        pair_with_labels(results / "0001.txt", labels)
    with fault(LabelError, expected="a seqmap", found="no file"):
        pair_with_labels(results, labels, tmp_path / "nowhere.txt")


@pytest.mark.parametrize(
    "row",
    ["0001 empty 000000", "0001 empty 000000 many", "0001 empty 0 0", "0000 empty 0 5"],
    ids=["too short", "no number", "no frames", "named twice"],
)
def test_a_bad_row_of_a_seqmap(tmp_path, row):
    path = tmp_path / "seqmap.txt"
    path.write_text(f"0000 empty 000000 000154\n{row}\n")
    with fault(LabelError, where="row 2", expected="a sequence that is named once"):
        read_seqmap(path)
    assert read_seqmap_of(path, "0000 empty 000000 000154") == {"0000": 154}


def read_seqmap_of(path: Path, text: str) -> dict[str, int]:
    path.write_text(text)
    return read_seqmap(path)
