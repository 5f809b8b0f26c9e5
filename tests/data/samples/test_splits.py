"""Splits: sizes, seeds, and lists of frames."""

from pathlib import Path

import numpy as np
import pytest

from data.samples.splits import random_split, split_from_lists
from perception.errors import LabelError, UsageError
from tests.faults import fault

KITTI_FRAMES = 7481


def sizes_of(**options: object) -> tuple[int, int, int]:
    drives = np.zeros(KITTI_FRAMES, np.int64)
    split = random_split(drives, **{"by": "frames", "seed": 0, **options})
    return len(split.training), len(split.validation), len(split.test)


def test_the_thesis_splits_have_its_sizes():
    assert sizes_of(validation_fraction=0.2, test_fraction=0.2) == (4489, 1496, 1496)  # 7.2.2
    assert sizes_of(validation_fraction=0.2, test_fraction=0.0) == (5985, 1496, 0)  # B


def test_parts_share_no_frame_and_depend_on_the_seed():
    drives = np.zeros(50, np.int64)
    first, again, other = (
        random_split(drives, validation_fraction=0.2, test_fraction=0.2, by="frames", seed=seed)
        for seed in (3, 3, 4)
    )
    parts = first.training, first.validation, first.test
    assert sorted(np.concatenate(parts).tolist()) == list(range(50))
    for part in parts:
        assert (np.diff(part) > 0).all()
    np.testing.assert_array_equal(first.validation, again.validation)
    assert set(first.validation) != set(other.validation)


def test_drives_are_kept_back_whole():
    drives = np.repeat(np.arange(10), 3)
    split = random_split(drives, validation_fraction=0.2, test_fraction=0.1, by="drives", seed=0)
    for part, count in ((split.training, 7), (split.validation, 2), (split.test, 1)):
        names, frames = np.unique(drives[part], return_counts=True)
        assert (len(names), set(frames)) == (count, {3})


def test_lists_name_frames_by_the_numbers_of_their_files(tmp_path: Path):
    lists = tmp_path / "train.txt", tmp_path / "val.txt"
    lists[0].write_text("000009\n000003\n\n000003\n")
    lists[1].write_text("5\n")
    split = split_from_lists(np.array([3, 5, 8, 9]), lists)
    assert split.training.tolist() == [0, 3]
    assert split.validation.tolist() == [1]
    assert len(split.test) == 0


@pytest.mark.parametrize(
    ("text", "where", "expected", "found"),
    [
        ("3\n7\n", "val.txt row 2", "3 frames from 000003 to 000008", "'7'"),
        ("three\n", "val.txt row 1", "3 frames from 000003 to 000008", "'three'"),
        ("\n", "val.txt", "frame numbers, one per line", "none"),
    ],
)
def test_a_list_that_does_not_fit_the_drive_is_refused(
    tmp_path: Path, text: str, where: str, expected: str, found: str
):
    lists = tmp_path / "train.txt", tmp_path / "val.txt"
    lists[0].write_text("5\n")
    lists[1].write_text(text)
    with fault(LabelError, where, expected, found):
        split_from_lists(np.array([3, 5, 8]), lists)


def test_a_missing_list_is_named(tmp_path: Path):
    with fault(LabelError, "none.txt", "a list of frame numbers"):
        split_from_lists(np.array([3]), (tmp_path / "none.txt", tmp_path / "none.txt"))


def test_a_frame_on_both_lists_is_refused(tmp_path: Path):
    both = tmp_path / "both.txt"
    both.write_text("5\n")
    with fault(UsageError, expected="no frame on both lists", found="1, 000005 the first"):
        split_from_lists(np.array([3, 5]), (both, both))
