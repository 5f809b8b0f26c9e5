"""Which frames are learned from, which are judged by while learning, and which are kept for the end."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from data.kitti.labels import read_label_lines
from data.splitting import SplitBy, split_rng, validation_frames
from perception.errors import LabelError, UsageError
from perception.types import Int


@dataclass(frozen=True)
class Split:
    """Numbers of frames in rising order, none of them twice.

    Attributes:
        training: (T,) learned from.
        validation: (V,) judged by while it is learned.
        test: (E,) kept for the end.
    """

    training: Int
    validation: Int
    test: Int


def random_split(
    drive_numbers: Int, *, validation_fraction: float, test_fraction: float, by: SplitBy, seed: int
) -> Split:
    """Draw a split; the thesis' are 60/20/20 (7.2.2) and 80/20 (B).

    Args:
        drive_numbers: (F,) which drive each frame is of.
        validation_fraction: of all frames or drives; 0 keeps none back.
        test_fraction: likewise.
        by: draw single frames, or whole drives.
        seed: of the draw.

    Raises:
        UsageError: a share is not 0 but leaves nothing of a part, or nothing to learn from.
    """
    rng = split_rng(seed)
    left = np.arange(len(drive_numbers))
    parts, taken = [], 0.0
    for share in (test_fraction, validation_fraction):
        is_part = np.zeros(len(left), bool)
        if share > 0:
            is_part = validation_frames(drive_numbers[left], share / (1 - taken), by, rng)
        parts.append(left[is_part])
        left, taken = left[~is_part], share
    return Split(left, validation=parts[1], test=parts[0])


def split_from_lists(file_numbers: Int, lists: tuple[Path, Path]) -> Split:
    """Read a split from two files of frame numbers, a line each, such as KITTI's 3712 and 3769.

    Args:
        file_numbers: (F,) by which the frames of one drive are named.
        lists: those learned from, and those judged by.

    Raises:
        LabelError: a list cannot be read, is empty, or holds what is no number of a frame.
        UsageError: a frame is on both lists.
    """
    row_of = {number: row for row, number in enumerate(file_numbers.tolist())}
    training, validation = (_listed(path, row_of) for path in lists)
    common = np.intersect1d(training, validation)
    if len(common):
        raise UsageError(
            f"{lists[0]} and {lists[1]}",
            expected="no frame on both lists",
            found=f"{len(common)}, {file_numbers[common[0]]:06d} the first",
        )
    return Split(training, validation, test=np.zeros(0, np.int64))


def _listed(path: Path, row_of: dict[int, int]) -> Int:
    words = [line.strip() for line in read_label_lines(path, "a list of frame numbers")]
    if not words:
        raise LabelError(path, expected="frame numbers, a line each", found="none")
    for row, word in enumerate(words, start=1):
        if not (word.isdigit() and int(word) in row_of):
            known = f"{len(row_of)} frames from {min(row_of):06d} to {max(row_of):06d}"
            raise LabelError(
                f"{path} row {row}",
                expected=f"the number of a frame of the drive, which has {known}",
                found=repr(word),
            )
    return np.unique([row_of[int(word)] for word in words])
