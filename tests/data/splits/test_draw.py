"""Drawn splits: sizes, seeds, units."""

from collections.abc import Callable

import pytest

from data.kitti.objects import ObjectFrames
from data.splits.draw import draw_split
from data.splits.frame_split import FrameSplit
from data.splits.parts import PARTS
from perception.errors import DriveError, UsageError
from tests.faults import fault

MakeDrive = Callable[..., ObjectFrames]
KITTI_FRAMES = 7481


def sizes(split: FrameSplit) -> list[int]:
    return [sum(len(one.frames.get(part, ())) for one in split.drives) for part in PARTS]


@pytest.mark.parametrize(
    ("shares", "expected"),
    [((60, 20, 20), [4489, 1496, 1496]), ((80, 20), [5985, 1496, 0])],  # 7.2.2; 7.2.1 and B
)
def test_the_splits_of_the_thesis_have_its_sizes(make_drive: MakeDrive, shares, expected):
    split = draw_split([make_drive(KITTI_FRAMES)], shares, by="frames", seed=0)
    assert sizes(split) == expected
    assert split.parts == PARTS[: len(shares)]


def test_parts_share_no_frame_and_depend_on_the_seed_alone(make_drive: MakeDrive):
    first, again, other = (
        draw_split([make_drive(50)], (60, 20, 20), by="frames", seed=seed) for seed in (3, 3, 4)
    )
    names = [name for part in PARTS for name in first.drives[0].frames[part]]
    assert sorted(names) == [f"{number:06d}" for number in range(50)]
    assert first == again
    assert first.fingerprint == again.fingerprint != other.fingerprint


def test_a_smaller_training_part_is_within_a_larger_one(make_drive: MakeDrive):
    drives = [make_drive(50)]
    small, large = (
        draw_split(drives, shares, by="frames", seed=1) for shares in ((60, 20, 20), (80, 20))
    )
    assert set(small.drives[0].frames["train"]) < set(large.drives[0].frames["train"])


def test_drives_are_drawn_whole(make_drive: MakeDrive):
    drives = [make_drive(3 + number, f"{number:04d}") for number in range(10)]
    split = draw_split(drives, (70, 20, 10), by="drives", seed=0)
    parts = [part for one in split.drives for part in one.frames]
    assert [parts.count(part) for part in PARTS] == [7, 2, 1]
    for one, drive in zip(split.drives, drives, strict=True):
        assert list(one.frames.values()) == [drive.scans.names]


@pytest.mark.parametrize(
    ("shares", "by", "found"),
    [
        ((99, 1), "frames", "5 in train, 0 in val"),
        ((50, 50), "drives", "1 in train, 0 in val"),
        ((60, 20), "frames", "60,20"),
        ((100,), "frames", "100"),
        ((120, -20), "frames", "120,-20"),
        ((40, 20, 20, 20), "frames", "40,20,20,20"),
    ],
)
def test_shares_that_leave_a_part_empty_are_refused(make_drive: MakeDrive, shares, by, found):
    with fault(UsageError, "shares", found=found):
        draw_split([make_drive(5)], shares, by=by, seed=0)


def test_no_drive_is_refused():
    with fault(DriveError, expected="at least one drive", found="none"):
        draw_split([], (80, 20), by="frames", seed=0)
