"""Which frames are learned from, and which are kept back to judge by."""

from typing import Literal

import numpy as np

from perception.errors import UsageError
from perception.types import Bool, Int

SplitBy = Literal["frames", "drives"]
_STREAM = 0x5B  # of random numbers


def split_rng(seed: int) -> np.random.Generator:
    """Return what draws the frames that are kept back: of one seed always the same."""
    return np.random.default_rng([seed, _STREAM])


def validation_frames(
    drive_numbers: Int, share: float, by: SplitBy, rng: np.random.Generator
) -> Bool:
    """Draw (F,) which frames are kept back.

    Args:
        drive_numbers: (F,) which drive each frame is of.
        share: of the frames, or of the drives, that are kept back.
        by: draw single frames, or whole drives: neighbouring frames of a drive are nearly the same.
        rng: draws.

    Raises:
        UsageError: nothing would be left to learn from, or nothing to judge by.
    """
    groups = np.arange(len(drive_numbers)) if by == "frames" else drive_numbers
    names = np.unique(groups)
    count = round(share * len(names))
    if not 0 < count < len(names):
        raise UsageError(
            f"validation share {share:g}",
            expected=f"some of {len(names)} {by} to be kept back, and some to be left",
            found=f"{count} of them kept back",
            advice="split by frames, change the share, or name drives to validate on",
        )
    return np.isin(groups, rng.choice(names, count, replace=False))
