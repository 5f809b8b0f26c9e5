"""Data of two clocks joined by time: to each scan the image, pose or packet that is nearest to it."""

import numpy as np

from perception.types import Float64, Int

NONE = -1  # index of a scan to which nothing is near enough


def nearest_in_time(
    stamps_s: Float64, other_stamps_s: Float64, max_gap_s: float | None = None
) -> Int:
    """Return to each of F stamps the index of the nearest of K others, or `NONE`.

    Args:
        stamps_s: (F,) times of the scans.
        other_stamps_s: (K,) times of the other data in any order, by the same clock; NaN where unknown.
        max_gap_s: Time from which nothing is near; None for half the median period of the scans.

    Returns:
        (F,) indices into the K others. Of two that are as near, the earlier is taken.
    """
    others = np.asarray(other_stamps_s, np.float64)
    order = np.argsort(others, kind="stable")
    order = order[~np.isnan(others[order])]
    if not len(order):
        return np.full(len(stamps_s), NONE, np.int64)
    limit_s = half_period_s(stamps_s) if max_gap_s is None else max_gap_s
    sorted_s, stamps_s = others[order], np.asarray(stamps_s, np.float64)
    after = np.searchsorted(sorted_s, stamps_s).clip(0, len(order) - 1)
    before = (after - 1).clip(0)
    is_before = np.abs(stamps_s - sorted_s[before]) <= np.abs(sorted_s[after] - stamps_s)
    nearest = np.where(is_before, before, after)
    # False with NaN, too.
    is_near = np.abs(sorted_s[nearest] - stamps_s) <= limit_s
    return np.where(is_near, order[nearest], NONE)


def half_period_s(stamps_s: Float64) -> float:
    """Return half the median time from one scan to the next; infinity for a single scan."""
    steps_s = np.diff(np.sort(np.asarray(stamps_s, np.float64)))
    steps_s = steps_s[steps_s > 0]
    return float(np.median(steps_s)) / 2 if len(steps_s) else np.inf
