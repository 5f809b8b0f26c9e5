"""Splits of frames into training, validation and test."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from data.kitti.reading import read_label_lines
from data.samples.config import SplitBy
from perception.errors import LabelError, UsageError
from perception.types import Bool, Int

_STREAM = 0x5B  # stream of random numbers


@dataclass(frozen=True)
class Split:
    """Numbers of frames in rising order, none of them twice.

    Attributes:
        training: (T,) frames for training.
        validation: (V,) frames for validation during training.
        test: (E,) frames for the final test.
    """

    training: Int
    validation: Int
    test: Int


def split_rng(seed: int) -> np.random.Generator:
    """Return the generator that draws the frames kept back; one seed always draws the same."""
    return np.random.default_rng([seed, _STREAM])


def validation_frames(
    drive_numbers: Int, fraction: float, by: SplitBy, rng: np.random.Generator
) -> Bool:
    """Draw the (F,) mask of the frames kept back.

    Args:
        drive_numbers: (F,) number of the drive of each frame.
        fraction: Fraction of the frames, or of the drives, kept back.
        by: Unit that is drawn: single frames, or whole drives, since neighbouring frames are nearly equal.
        rng: Random generator.

    Raises:
        UsageError: nothing would be left for training, or for validation.
    """
    groups = np.arange(len(drive_numbers)) if by == "frames" else drive_numbers
    names = np.unique(groups)
    count = round(fraction * len(names))
    if not 0 < count < len(names):
        raise UsageError(
            f"validation fraction {fraction:g}",
            expected=f"some of {len(names)} {by} for validation, and some for training",
            found=f"{count} for validation",
            advice="split by frames, change the fraction, or name validation drives",
        )
    return np.isin(groups, rng.choice(names, count, replace=False))


def random_split(
    drive_numbers: Int,
    *,
    validation_fraction: float,
    test_fraction: float = 0.0,
    by: SplitBy,
    seed: int,
) -> Split:
    """Draw a split; the thesis' are 60/20/20 (7.2.2) and 80/20 (7.2.1, B).

    Args:
        drive_numbers: (F,) number of the drive of each frame.
        validation_fraction: Fraction of all frames or drives for validation; 0 for none.
        test_fraction: Fraction of all frames or drives for the test; 0 for none.
        by: Unit that is drawn: single frames, or whole drives.
        seed: Seed of the draw.

    Raises:
        UsageError: a fraction above 0 draws nothing, or leaves nothing for training.
    """
    rng = split_rng(seed)
    left = np.arange(len(drive_numbers))
    parts, taken = [], 0.0
    for fraction in (test_fraction, validation_fraction):
        is_part = np.zeros(len(left), bool)
        if fraction > 0:
            is_part = validation_frames(drive_numbers[left], fraction / (1 - taken), by, rng)
        parts.append(left[is_part])
        left, taken = left[~is_part], fraction
    return Split(left, validation=parts[1], test=parts[0])


def split_from_lists(file_numbers: Int, lists: tuple[Path, Path]) -> Split:
    """Read a split from two files of frame numbers, one per line, such as KITTI's 3712 and 3769.

    Args:
        file_numbers: (F,) numbers by which the frames of one drive are named.
        lists: Files of the training and of the validation frames.

    Raises:
        LabelError: a list cannot be read, is empty, or has an entry that is no frame number.
        UsageError: a frame is on both lists.
    """
    row_of = {number: row for row, number in enumerate(file_numbers.tolist())}
    training, validation = (_read_list(path, row_of) for path in lists)
    common = np.intersect1d(training, validation)
    if len(common):
        raise UsageError(
            f"{lists[0]} and {lists[1]}",
            expected="no frame on both lists",
            found=f"{len(common)}, {file_numbers[common[0]]:06d} the first",
        )
    return Split(training, validation, test=np.zeros(0, np.int64))


def _read_list(path: Path, row_of: dict[int, int]) -> Int:
    words = [line.strip() for line in read_label_lines(path, "a list of frame numbers")]
    if not words:
        raise LabelError(path, expected="frame numbers, one per line", found="none")
    for row, word in enumerate(words, start=1):
        if not (word.isdigit() and int(word) in row_of):
            known = f"{len(row_of)} frames from {min(row_of):06d} to {max(row_of):06d}"
            raise LabelError(
                f"{path} row {row}",
                expected=f"the number of a frame of the drive, which has {known}",
                found=repr(word),
            )
    return np.unique([row_of[int(word)] for word in words])
