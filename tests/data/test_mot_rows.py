"""Tracks in MOTChallenge's columns, told by their commas."""

import pytest

from data.kitti.mot_rows import are_mot_rows
from data.kitti.tracking_rows import read_result_rows
from perception.errors import LabelError
from tests.faults import fault

ROWS = "1,3,794.25,247.5,71.25,174.75,0.5,-1,-1,-1\n2, 3, 800, 250, 70, 170, 7\n"


@pytest.fixture
def path(tmp_path):
    return tmp_path / "0000.txt"


def test_frames_count_from_one_and_boxes_have_sizes(path):
    path.write_text(f"\n{ROWS}\n")
    rows = read_result_rows(path)
    assert (rows.frames.tolist(), rows.ids.tolist()) == ([0, 1], [3, 3])
    assert rows.boxes_px.tolist() == [[794.25, 247.5, 865.5, 422.25], [800, 250, 870, 420]]
    assert rows.scores.tolist() == [0.5, 7]
    assert rows.types.tolist() == ["", ""]
    assert rows.headings_rad.tolist() == [-10, -10]


def test_commas_tell():
    assert [are_mot_rows(row) for row in (ROWS, "0 1 Car 0 0", "")] == [True, False, False]


@pytest.mark.parametrize(
    ("row", "expected", "found"),
    [
        ("0,1,1,2,3,4,1", "frames from 1 on, as MOTChallenge counts", "'0' as frame"),
        ("1.5,1,1,2,3,4,1", "finite numbers, frame and id whole", "'1.5' as frame"),
        ("1,-1,1,2,3,4,1", "an id, as tracks have and detections have not", "'-1' as id"),
        ("1,1,1,2,-3,4,1", "a width and a height from 0 on", "'-3' as width"),
        ("1,1,x,2,3,4,1", "finite numbers", "'x' as left"),
        ("1,1,1,2,3,4,nan", "finite numbers", "'nan' as conf"),
        ("1,1,1,2,3,4", "7 to 10 columns with commas between", "6"),
        ("1,1,1,2,3,4,1,-1,-1,-1,-1", "7 to 10 columns", "11"),
        ("1,3,1,2,3,4,1", "every id once in a frame", "id 3 again in frame 1"),
    ],
)
def test_rows_that_cannot_be_read(path, row, expected, found):
    path.write_text(f"{ROWS}{row}\n")
    with fault(LabelError, "0000.txt row 3", expected, found):
        read_result_rows(path)


def test_frames_beyond_the_sequence_are_counted_as_in_the_file(path):
    path.write_text(ROWS)
    assert len(read_result_rows(path, frame_count=2)) == 2
    with fault(LabelError, "0000.txt row 2", "frames from 1 to 1", "'2'"):
        read_result_rows(path, frame_count=1)
