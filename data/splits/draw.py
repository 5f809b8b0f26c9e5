"""Draws of splits: frames or whole drives, by shares and a seed."""

from collections.abc import Mapping, Sequence

import numpy as np

from data.recorded_drive import RecordedDrive
from data.splits.frame_split import DriveParts, FrameSplit
from data.splits.parts import PARTS, Part, SplitBy
from perception.errors import DriveError, UsageError
from perception.types import Bool

_STREAM = 0x5B  # stream of random numbers
_MIN_PARTS = 2


def draw_split(
    drives: Sequence[RecordedDrive], shares: Sequence[float], *, by: SplitBy, seed: int
) -> FrameSplit:
    """Draw a split; the thesis' are 60, 20, 20 (7.2.2) and 80, 20 (7.2.1, B).

    Validation and test have their share of the units, rounded, and training has the rest: of 7481 frames 4489, 1496
    and 1496, as the thesis states. scikit-learn's GroupShuffleSplit rounds up, to 1497; it is also no dependency of
    what evaluates.

    Args:
        drives: Drives with labels.
        shares: Percentage of train, val and, where there are three, test.
        by: Unit that is drawn: single frames, or whole drives, since neighbouring frames are nearly equal.
        seed: Seed of the draw.

    Raises:
        UsageError: The shares are not of all, or leave a part without frames.
        DriveError: There is no drive.
    """
    if not drives:
        raise DriveError("drives", expected="at least one drive to split", found="none")
    require_shares(shares)
    numbers = np.repeat(np.arange(len(drives)), [len(drive) for drive in drives])
    units = np.arange(len(numbers)) if by == "frames" else numbers
    count = int(units[-1]) + 1
    # All parts are cut off one order: with one seed, a training part of 60 % is within one of 80 %.
    order = np.random.default_rng([seed, _STREAM]).permutation(count)
    drawn = np.split(order, np.cumsum(_counts(count, shares, by))[:-1])
    is_in = {part: np.isin(units, of_part) for part, of_part in zip(PARTS, drawn, strict=False)}
    parts = [
        _drive_parts(drive, {part: mask[numbers == number] for part, mask in is_in.items()})
        for number, drive in enumerate(drives)
    ]
    return FrameSplit(tuple(parts), by, tuple(shares), seed)


def require_shares(shares: Sequence[float]) -> None:
    """Validate percentages of two or three parts.

    Raises:
        UsageError: They are not above 0, or do not sum up to 100.
    """
    is_whole = abs(sum(shares) - 100) < 1e-6 and min(shares, default=0) > 0
    if not is_whole or not _MIN_PARTS <= len(shares) <= len(PARTS):
        raise UsageError(
            "shares",
            expected="two or three percentages above 0 that sum up to 100, such as 60,20,20",
            found=",".join(f"{share:g}" for share in shares),
        )


def split_in_time(
    drives: Sequence[RecordedDrive], kept: float, gap_s: float
) -> tuple[DriveParts, ...]:
    """Return the first frames of each drive as part train, and its last ones as part val.

    Args:
        drives: Drives.
        kept: Share of the frames that is of part val, 0 to 1.
        gap_s: Time before them in seconds of which the frames are of no part, as neighbouring ones are nearly equal.

    Raises:
        UsageError: A part of a drive has no frame.
    """
    parts = []
    for drive in drives:
        first = len(drive) - round(kept * len(drive))
        stamps_s = np.array([drive.stamp_s(index) for index in range(len(drive))])
        is_val = np.arange(len(drive)) >= first
        is_train = ~is_val & (stamps_s < stamps_s[is_val].min(initial=np.inf) - gap_s)
        if not (is_train.any() and is_val.any()):
            raise UsageError(
                f"{kept:g} of {drive.name} kept apart",
                expected=f"frames before and after a gap of {gap_s:g} s",
                found=f"{len(drive)} frames of {np.ptp(stamps_s):.1f} s",
                advice="take a longer drive",
            )
        parts.append(_drive_parts(drive, {"train": is_train, "val": is_val}))
    return tuple(parts)


def _counts(units: int, shares: Sequence[float], by: SplitBy) -> list[int]:
    others = [round(share / 100 * units) for share in shares[1:]]
    counts = [units - sum(others), *others]
    if min(counts) < 1:
        raise UsageError(
            f"shares {','.join(f'{share:g}' for share in shares)}",
            expected=f"some of {units} {by} in each part",
            found=", ".join(f"{n} in {part}" for part, n in zip(PARTS, counts, strict=False)),
            advice="split by frames, change the shares, or name more drives",
        )
    return counts


def _drive_parts(drive: RecordedDrive, is_in: Mapping[Part, Bool]) -> DriveParts:
    names = np.array(drive.frame_names)
    frames = {part: tuple(names[mask].tolist()) for part, mask in is_in.items() if mask.any()}
    return DriveParts(drive.root.resolve(), drive.name, frames)


def require_labels(drives: Sequence[RecordedDrive]) -> None:
    """Validate that every drive has labelled boxes.

    Raises:
        UsageError: A drive has none.
    """
    for drive in drives:
        if not drive.has_labels:
            raise UsageError(
                drive.root,
                expected="labelled boxes in every drive",
                found=f"none of {drive.name}",
                advice="name drives with labels, such as KITTI's training folder",
            )
