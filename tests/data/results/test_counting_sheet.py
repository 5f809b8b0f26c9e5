from pathlib import Path

import pytest

from data.results.counted_scans import (
    CountedImage,
    choose_frames,
    read_counting_sheet,
    write_counting_sheet,
)
from perception.errors import LabelError
from perception.evaluation.obstacle_counts import ObstacleCounts
from tests.faults import fault

COUNTS = ObstacleCounts(12, 3, 2, 1, 4, 0)


@pytest.fixture
def sheet(tmp_path: Path) -> Path:
    """Return a sheet of two images, the first of which is counted."""
    rows = [
        CountedImage("0000", "000007", "0000_000007.jpg", COUNTS),
        CountedImage("0011", "000300", "0011_000300.jpg", None),
    ]
    path = tmp_path / "new" / "sheet.csv"
    write_counting_sheet(path, rows)
    assert read_counting_sheet(path) == rows
    return path


def test_a_person_fills_in_the_empty_counts(sheet: Path):
    text = sheet.read_text()
    assert text.splitlines()[2] == "0011,000300,0011_000300.jpg,,,,,,"
    sheet.write_text(text.replace(",,,,,,", ",12,3,2,1, 4 ,0"))
    assert [row.counts for row in read_counting_sheet(sheet)] == [COUNTS, COUNTS]


@pytest.mark.parametrize(
    "counts",
    [
        "12,3,2,1,4,",
        "12,3,2,1,four,0",
        "12,3,2,1,-4,0",
        "3,12,0,0,0,0",
        "3,2,4,0,0,0",
        "3,2,0,3,0,0",
    ],
)
def test_counts_that_cannot_be_are_an_error(sheet: Path, counts: str):
    sheet.write_text(sheet.read_text().replace(",,,,,,", f",{counts}"))
    with fault(LabelError, where="sheet.csv row 3", found=counts.replace(",", ", ").strip()):
        read_counting_sheet(sheet)


def test_another_table_is_an_error(sheet: Path):
    sheet.write_text("frame,moving\n1,2\n")
    with fault(LabelError, where="sheet.csv", expected="missed_obstacles", found="frame, moving"):
        read_counting_sheet(sheet)


def test_the_seed_chooses_the_frames_of_each_sequence():
    chosen = choose_frames("0000", 154, 25, seed=0).tolist()
    assert len({*chosen}) == 25
    assert chosen == sorted(chosen)
    assert 0 <= chosen[0] < chosen[-1] < 154
    assert chosen == choose_frames("0000", 154, 25, seed=0).tolist()
    assert chosen != choose_frames("0000", 154, 25, seed=1).tolist()
    assert chosen != choose_frames("0001", 154, 25, seed=0).tolist()
    assert choose_frames("0000", 4, 25, seed=0).tolist() == [0, 1, 2, 3]
