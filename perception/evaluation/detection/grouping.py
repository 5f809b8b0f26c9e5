"""Rows that belong together: their pairs, and their place among each other."""

import numpy as np

from perception.types import Int


def pairs_in_groups(first: Int, second: Int) -> tuple[Int, Int]:
    """Return the row numbers of all pairs of a first and a second row that are of the same group.

    Args:
        first: (A,) group of each first row.
        second: (B,) group of each second row, never falling.

    Returns:
        Rows of the first, which never fall, and rows of the second, which rise for each of these.
    """
    starts = np.searchsorted(second, first, side="left")
    counts = np.searchsorted(second, first, side="right") - starts
    rows = np.repeat(np.arange(len(first)), counts)
    skipped = np.cumsum(counts) - counts
    return rows, np.arange(len(rows)) + np.repeat(starts - skipped, counts)


def ranks_in_groups(groups: Int) -> Int:
    """Return (A,) how many rows of the same group come before each row."""
    order = np.argsort(groups, kind="stable")
    ordered = groups[order]
    ranks = np.empty(len(groups), np.int64)
    ranks[order] = np.arange(len(groups)) - np.searchsorted(ordered, ordered)
    return ranks
