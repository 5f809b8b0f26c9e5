"""Folders of detections and labels as plain rows, good and bad."""

from pathlib import Path

import pytest

from data.kitti.detection_rows import read_detection_set, read_frame_list
from perception.errors import DriveError, LabelError
from perception.evaluation.detection.average_precision import kitti_average_precision
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from tests.faults import fault

CAR = "Car 0.10 1 -1.57 599.41 156.40 629.75 189.25 1.5 1.6 3.9 0.47 1.49 69.44 -1.56"
DONT_CARE = "DontCare -1 -1 -10 10 20 30 40 -1 -1 -1 -1000 -1000 -1000 -10"
FOUND = "Car -1 -1 -1.50 600 157 630 190 -1 -1 -1 -1000 -1000 -1000 -10 0.93"


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    """Return results of frames 3 and 7, and labels of 3, 5 and 7."""
    write(tmp_path / "results", {3: f"{FOUND}\n{FOUND} \n\n", 7: ""})
    write(tmp_path / "labels", {3: f"{CAR}\n{DONT_CARE}\n", 5: "", 7: f"{CAR} 0.5\n"})
    return tmp_path / "results", tmp_path / "labels"


def write(folder: Path, texts: dict[int, str]) -> None:
    folder.mkdir(parents=True)
    for number, text in texts.items():
        (folder / f"{number:06d}.txt").write_text(text)


def test_rows_are_as_written(folders):
    found = read_detection_set(*folders)
    assert found.numbers == (3, 5, 7)
    truths, detections = found.truths, found.detections
    assert truths.frames.tolist() == [0, 0, 2]
    assert truths.types.tolist() == ["Car", "DontCare", "Car"]
    assert truths.truncation.tolist() == [0.1, -1, 0.1]
    assert truths.occlusion.tolist() == [1, -1, 1]
    assert truths.alphas_rad.tolist() == [-1.57, -10, -1.57]
    assert truths.boxes_px[1].tolist() == [10, 20, 30, 40]
    assert detections.frames.tolist() == [0, 0]
    assert detections.boxes_px[0].tolist() == [600, 157, 630, 190]
    assert detections.scores.tolist() == [0.93, 0.93]
    assert detections.alphas_rad.tolist() == [-1.5, -1.5]


def test_a_missing_result_file_means_no_detections(folders):
    (folders[0] / "000011.txt").write_text(FOUND)
    found = read_detection_set(*folders)
    assert found.missing_results == (5,)
    assert found.extra_results == (11,)
    assert 1 not in found.detections.frames


def test_a_list_names_the_frames_and_their_order(folders, tmp_path: Path):
    frame_list = tmp_path / "val.txt"
    frame_list.write_text("000007\n\n3\n")
    numbers = read_frame_list(frame_list)
    assert numbers == (7, 3)
    found = read_detection_set(*folders, numbers)
    assert found.truths.frames.tolist() == [0, 1, 1]
    assert found.detections.frames.tolist() == [1, 1]


@pytest.mark.parametrize("inner", ["label_2", "training/label_2"])
def test_roots_hold_the_folders(tmp_path: Path, inner: str):
    write(tmp_path / "object" / inner, {0: CAR})
    write(tmp_path / "made" / "data", {0: FOUND})
    found = read_detection_set(tmp_path / "made", tmp_path / "object")
    assert (len(found.truths), len(found.detections)) == (1, 1)


def test_labels_without_objects_and_results_without_rows(tmp_path: Path):
    write(tmp_path / "results", {0: ""})
    write(tmp_path / "labels", {0: "", 1: DONT_CARE})
    found = read_detection_set(tmp_path / "results", tmp_path / "labels")
    assert (len(found.truths), len(found.detections)) == (1, 0)
    assert found.detections.boxes_px.shape == (0, 4)
    figures = kitti_average_precision(pair_boxes(found.truths, found.detections, 2))
    assert list(figures.values()) == [{}, {}, {}]


@pytest.mark.parametrize(
    ("row", "sentence"),
    [
        (FOUND.rsplit(" ", 1)[0], "row 2: expected 16 columns, type to score, found 15"),
        (f"{FOUND} 1", "row 2: expected 16 columns, type to score, found 17"),
        ("Car", "row 2: expected 16 columns, type to score, found 1"),
        (FOUND.replace("0.93", "nan"), "finite numbers after the type, as score is, found 'nan'"),
        (FOUND.replace("0.93", "-inf"), "as score is, found '-inf'"),
        (FOUND.replace("630", "6e3o"), "as x2 is, found '6e3o'"),
    ],
)
def test_results_that_cannot_be_read(folders, row: str, sentence: str):
    (folders[0] / "000007.txt").write_text(f"{FOUND}\n\n{row}\n")
    with pytest.raises(LabelError) as caught:
        read_detection_set(*folders)
    assert str(caught.value).startswith(f"{folders[0] / '000007.txt'} row 2: expected ")
    assert str(caught.value).endswith(sentence)


@pytest.mark.parametrize(
    ("row", "sentence"),
    [
        ("Car 0 0 1", "expected 15 columns, type to ry, found 4"),
        (CAR.replace(" 1 ", " one ", 1), "as occlusion is, found 'one'"),
        (CAR.replace("0.10", "NaN"), "as truncation is, found 'NaN'"),
    ],
)
def test_labels_that_cannot_be_read(folders, row: str, sentence: str):
    (folders[1] / "000005.txt").write_text(row)
    with pytest.raises(LabelError) as caught:
        read_detection_set(*folders)
    assert str(caught.value).startswith(f"{folders[1] / '000005.txt'} row 1: expected ")
    assert str(caught.value).endswith(sentence)


def test_files_that_are_not_there(folders, tmp_path: Path):
    results, labels = folders
    with fault(LabelError, where="000004.txt", found="no file"):
        read_detection_set(results, labels, (3, 4))
    with fault(DriveError, expected="texts named 000000.txt", found="no folder"):
        read_detection_set(tmp_path / "nowhere", labels)
    (tmp_path / "empty").mkdir()
    with fault(DriveError, found="no such file"):
        read_detection_set(results, tmp_path / "empty")
    (results / "3.txt").write_text("")
    with fault(DriveError, str(results), "one text of each frame", "000003.txt and 3.txt"):
        read_detection_set(results, labels)
    write(tmp_path / "others", {100: FOUND})
    with fault(DriveError, expected="results of the 3 frames", found="1 result files of other"):
        read_detection_set(tmp_path / "others", labels)


@pytest.mark.parametrize(
    ("text", "where", "expected", "found"),
    [
        ("1\nx2\n", "row 2", "a frame number", "'x2'"),
        ("1\n2\n01\n", "row 3", "each frame once", "01 as in row 1"),
        ("\n", "val.txt", "frame numbers", "none"),
    ],
)
def test_lists_that_cannot_be_read(
    tmp_path: Path, text: str, where: str, expected: str, found: str
):
    frame_list = tmp_path / "val.txt"
    frame_list.write_text(text)
    with fault(LabelError, where=where, expected=expected, found=found):
        read_frame_list(frame_list)
